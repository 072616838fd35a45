"""The objective: its gradient, its scale, and pixels that see nothing."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.cost.objective import Objective, estimate_noise, evaluate
from mitsuba_endo.solve.cost.problem import Problem
from mitsuba_endo.solve.optimise.adam import gradient
from mitsuba_endo.solve.unknowns.state import State
from mitsuba_endo.solve.unknowns.stepping import apply_step
from tests.rigs import with_noise, with_outliers
from tests.solve.problems import LAWS, problem_of, small_rig
from tests.solve.test_normal import problem as two_frames

RIG = with_outliers(with_noise(small_rig("pinhole"), 0.3, 0), 0.05, 1)


def beside(built: Problem, state: State) -> State:
    """A state a few standard deviations away from ``state``."""
    rng = np.random.default_rng(5)
    rho = [r * rng.normal(0, 0.002, len(r)) for r in state.rho]
    return apply_step(built.plan, state, rho, rng.normal(0, 0.002, built.plan.columns))


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("stage", [0, 1])
class TestGradient:
    def check(self, built: Problem, state: State, stage: int) -> None:
        objective = Objective(built, "tukey", sigma=0.3, stage=stage)
        state = beside(built, state)
        surfaces, globals_ = gradient(objective, state)
        normal = objective.normal_equations(evaluate(built, state))
        np.testing.assert_allclose(globals_, normal.g, rtol=1e-8, atol=1e-8 * abs(normal.g).max())
        for found, block in zip(surfaces, normal.surfaces, strict=True):
            np.testing.assert_allclose(found, block.g, rtol=1e-8, atol=1e-8 * abs(block.g).max())
        zero = [np.zeros_like(r) for r in state.rho]
        rng = np.random.default_rng(0)
        for i in range(built.plan.columns):
            step = 1e-6 * np.eye(built.plan.columns)[i]
            numeric = self.difference(objective, state, zero, step)
            assert numeric == pytest.approx(globals_[i], rel=2e-3, abs=1e-3 * abs(globals_).max())
        for s, rho in enumerate(state.rho):
            change = [z.copy() for z in zero]
            change[s] = 1e-6 * rho * rng.normal(size=len(rho))
            numeric = self.difference(objective, state, change, np.zeros(built.plan.columns))
            assert numeric == pytest.approx(surfaces[s] @ change[s] / 1e-6, rel=2e-3)

    def difference(
        self, objective: Objective, state: State, rho: list[np.ndarray], step: np.ndarray
    ) -> float:
        """Central difference of the cost per 1e-6 of the step."""
        plan = objective.problem.plan
        ends = [
            objective.cost(
                evaluate(objective.problem, apply_step(plan, state, [s * r for r in rho], s * step))
            )
            for s in (1.0, -1.0)
        ]
        return (ends[0] - ends[1]) / 2e-6

    @pytest.mark.parametrize("law", LAWS)
    def test_of_one_frame(self, law: str, stage: int):
        """Oracle: central differences of the cost; the normal equations' right-hand side."""
        rig = with_outliers(with_noise(small_rig(law), 0.3, 0), 0.05, 1)
        self.check(*problem_of([rig]), stage)

    def test_of_observations_known_unequally_well(self, stage: int):
        """Oracle: as above, with weights."""
        built, state = problem_of([with_noise(small_rig("pinhole"), 0.3, 0)])
        weight = np.random.default_rng(7).uniform(0.02, 1.0, built.frames[0].count)
        built.frames[0] = replace(built.frames[0], weight=weight)
        self.check(built, state, stage)

    def test_of_two_frames(self, stage: int):
        """Oracle: as above, two surfaces, one pose, an unknown centre."""
        self.check(*two_frames(False, projector_pose="shared", centre="shared"), stage)


@pytest.mark.usefixtures("llvm")
class TestScale:
    def test_noise_is_robust(self):
        """Oracle: the standard deviation of Gaussian residuals, 5 % gross errors or none."""
        built, state = problem_of([small_rig("pinhole")])
        at = evaluate(built, state)
        rng = np.random.default_rng(0)
        noise = rng.normal(0, 0.4, at.residuals[0].shape)
        at.residuals[0] = noise
        assert estimate_noise(at) == pytest.approx(0.4, rel=0.03)
        at.residuals[0] = np.where(rng.random(noise.shape[1]) < 0.05, 50.0, noise)
        assert estimate_noise(at) == pytest.approx(0.4, rel=0.08)

    def test_falls_with_the_residuals_and_then_stays(self):
        """Oracle: it follows downwards only, until the last stage."""
        built, state = problem_of([RIG])
        objective = Objective(built, "tukey", sigma=2.0)
        at = evaluate(built, state)
        assert not objective.follow(at)
        fallen = objective.sigma
        assert fallen < 1.0
        assert objective.follow(at)
        worse = evaluate(built, state.with_(rho=[1.2 * r for r in state.rho]))
        assert objective.follow(worse)
        assert objective.sigma == fallen
        assert objective.next_stage(at)
        assert objective.loss.name == "tukey"
        assert not objective.next_stage(at)

    def test_pixels_that_leave_the_surface_do_not_lower_the_cost(self):
        """Oracle: the cost of a camera that looks away is that of as many gross errors."""
        built, state = two_frames(True)
        objective = Objective(built, "tukey", sigma=0.3, stage=1)
        away = RigidTransform.of([0, 2.0, 0], [0.0, 0, 0])
        at = evaluate(built, state.with_(world_from_camera=[RigidTransform.identity(), away]))
        assert not at.hits[1].any()
        assert objective.cost(at) > objective.cost(evaluate(built, state))
        assert objective.weights(at)[1].max() == 0
        missed = objective.cost(at) - objective.prior_cost(at.state)
        seen = float(objective.loss(at.squared(0), objective.scale).sum())
        worst = objective.scale**2 / 6  # plateau of the biweight
        assert missed - seen == pytest.approx(worst * built.frames[1].count, rel=1e-9)

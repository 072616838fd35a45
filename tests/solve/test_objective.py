"""The cost: its gradient, its scale, and pixels that see nothing."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.costs.coordinate_residual import CoordinateTerm
from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.costs.objective import Evaluation, Problem, evaluate, gradient
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import with_noise, with_outliers
from tests.solve.problems import PROJECTION_MODELS, problem_of, small_rig
from tests.solve.test_normal_equations import problem as two_frames

RIG = with_outliers(with_noise(small_rig("pinhole"), 0.3, 0), 0.05, 1)


def beside(built: Problem, state: State) -> State:
    """A state a few standard deviations away from ``state``."""
    rng = np.random.default_rng(5)
    rho = [r * rng.normal(0, 0.002, len(r)) for r in state.surfaces]
    return built.retract(state, rho, rng.normal(0, 0.002, built.layout.columns))


def whitened(built: Problem, whitening: np.ndarray) -> Problem:
    """The problem of one frame whose observations are known unequally well."""
    (term,) = built.frames
    observed = replace(term.observed, whitening=whitening)
    data = CoordinateTerm(observed, term.renderer, built.layout, keep=True)
    return replace(built, terms=[data, *built.others])


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("last", [False, True])
class TestGradient:
    def check(self, built: Problem, state: State, last: bool) -> None:
        noise = NoiseScale(0.3, "tukey", last)
        state, columns = beside(built, state), built.layout.columns
        found = gradient(built, state, noise)
        normal = evaluate(built, state).normal_equations(noise)
        largest = abs(found.unknowns).max()
        np.testing.assert_allclose(
            found.unknowns, normal.g, rtol=1e-8, atol=1e-8 * abs(normal.g).max()
        )
        for of_surface, block in zip(found.surfaces, normal.surfaces, strict=True):
            np.testing.assert_allclose(
                of_surface, block.g, rtol=1e-8, atol=1e-8 * abs(block.g).max()
            )
        zero = [np.zeros_like(r) for r in state.surfaces]
        rng = np.random.default_rng(0)
        for i in range(columns):
            step = 1e-6 * np.eye(columns)[i]
            numeric = self.difference(built, noise, state, zero, step)
            assert numeric == pytest.approx(found.unknowns[i], rel=2e-3, abs=1e-3 * largest)
        for s, rho in enumerate(state.surfaces):
            change = [z.copy() for z in zero]
            change[s] = 1e-6 * rho * rng.normal(size=len(rho))
            numeric = self.difference(built, noise, state, change, np.zeros(columns))
            assert numeric == pytest.approx(found.surfaces[s] @ change[s] / 1e-6, rel=2e-3)

    def difference(
        self,
        built: Problem,
        noise: NoiseScale,
        state: State,
        rho: list[np.ndarray],
        step: np.ndarray,
    ) -> float:
        """Central difference of the cost per 1e-6 of the step."""
        ends = [
            evaluate(built, built.retract(state, [s * r for r in rho], s * step)).cost(noise)
            for s in (1.0, -1.0)
        ]
        return (ends[0] - ends[1]) / 2e-6

    @pytest.mark.parametrize("law", PROJECTION_MODELS)
    def test_of_one_frame(self, law: str, last: bool):
        """Oracle: central differences of the cost; the normal equations' right-hand side."""
        rig = with_outliers(with_noise(small_rig(law), 0.3, 0), 0.05, 1)
        self.check(*problem_of([rig]), last)

    def test_of_observations_known_unequally_well(self, last: bool):
        """Oracle: as above, with weights."""
        built, state = problem_of([with_noise(small_rig("pinhole"), 0.3, 0)])
        weight = np.random.default_rng(7).uniform(0.02, 1.0, built.observed[0].count)
        self.check(whitened(built, np.sqrt(weight)), state, last)

    def test_of_components_that_are_correlated(self, last: bool):
        """Oracle: as above, with a matrix for every observation."""
        built, state = problem_of([with_noise(small_rig("pinhole"), 0.3, 0)])
        mixing = np.random.default_rng(8).normal(0, 0.3, (2, 2, built.observed[0].count))
        self.check(whitened(built, np.eye(2)[..., None] + mixing), state, last)

    def test_of_two_frames(self, last: bool):
        """Oracle: as above, two surfaces, one pose, an unknown centre."""
        self.check(*two_frames(False, projector_pose="shared", centre="shared"), last)


@pytest.mark.usefixtures("llvm")
def test_whitening_is_undone():
    """Oracle: the residuals before it; the squared length is that under the inverse covariance."""
    built, _ = problem_of([small_rig("pinhole")])
    observed, rng = built.observed[0], np.random.default_rng(3)
    residual = rng.normal(size=(2, observed.count))
    factors = (
        None,
        rng.uniform(0.1, 2, observed.count),
        np.eye(2)[..., None] + rng.normal(0, 0.3, (2, 2, observed.count)),
    )
    for W in factors:
        known = replace(observed, whitening=W)
        white = known.whitened(residual)
        np.testing.assert_allclose(known.unwhitened(white), residual, rtol=1e-9, atol=1e-9)
        if W is not None:
            matrix = np.eye(2)[..., None] * W if W.ndim == 1 else W
            inverse = np.einsum("kan,kbn->abn", matrix, matrix)
            squared = np.einsum("an,abn,bn->n", residual, inverse, residual)
            np.testing.assert_allclose((white**2).sum(0), squared, rtol=1e-9)


def with_residual(at: Evaluation, residual: np.ndarray) -> Evaluation:
    """The evaluation of one frame, as if its residuals were (2, N) others."""
    parts = [replace(p, residual=residual) if p is at.frames[0] else p for p in at.parts]
    return replace(at, parts=parts)


@pytest.mark.usefixtures("llvm")
class TestScale:
    def test_noise_is_robust(self):
        """Oracle: the standard deviation of Gaussian residuals, 5 % gross errors or none."""
        built, state = problem_of([small_rig("pinhole")])
        at = evaluate(built, state)
        rng = np.random.default_rng(0)
        noise = rng.normal(0, 0.4, at.frames[0].residual.shape)
        assert with_residual(at, noise).noise() == pytest.approx(0.4, rel=0.03)
        gross = np.where(rng.random(noise.shape[1]) < 0.05, 50.0, noise)
        assert with_residual(at, gross).noise() == pytest.approx(0.4, rel=0.08)

    def test_falls_with_the_residuals_and_then_stays(self):
        """Oracle: it follows downwards only, until the last stage."""
        built, state = problem_of([RIG])
        at = evaluate(built, state)
        fallen = NoiseScale(2.0, "tukey").followed(at.noise())
        assert fallen.sigma < 1.0
        assert fallen.loss.name == "cauchy"
        assert fallen.followed(at.noise()) == fallen
        worse = evaluate(built, state.with_surfaces(*(1.2 * r for r in state.surfaces)))
        assert worse.noise() > fallen.sigma
        assert fallen.followed(worse.noise()).sigma == fallen.sigma
        last = fallen.final(at.noise())
        assert last.loss.name == "tukey"
        assert last.sigma == at.noise()
        assert last.followed(0.5 * last.sigma) == last

    def test_pixels_that_leave_the_surface_do_not_lower_the_cost(self):
        """Oracle: the cost of a camera that looks away is that of as many gross errors."""
        built, state = two_frames(True)
        noise = NoiseScale(0.3, "tukey", last=True)
        away = RigidTransform.of([0, 2.0, 0], [0.0, 0, 0])
        at = evaluate(built, state.with_value("camera_pose", 1, away))
        assert not at.frames[1].hits.any()
        assert at.cost(noise) > evaluate(built, state).cost(noise)
        assert at.weights(noise)[1].max() == 0
        missed = at.cost(noise) - sum(t.cost(at.state, noise) for t in built.others)
        seen = float(noise.loss(at.squared(0), noise.scale).sum())
        worst = noise.scale**2 / 6  # plateau of the biweight
        assert missed - seen == pytest.approx(worst * built.observed[1].count, rel=1e-9)

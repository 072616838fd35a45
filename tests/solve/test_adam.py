"""The first-order solver against finite differences and against Gauss-Newton."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.cost.objective import Objective, evaluate
from mitsuba_endo.solve.optimise.adam import Moments, gradient
from mitsuba_endo.solve.optimise.run import optimise
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.prepare.frames import start_frame
from mitsuba_endo.solve.prepare.single import separate_surfaces
from mitsuba_endo.solve.unknowns.plan import make_plan
from mitsuba_endo.solve.unknowns.stepping import apply_step
from tests import rigs

OPTIONS = Options()


@pytest.fixture
def problem_and_start(llvm):
    """A bumpy sheet in 64 x 48 pixels with 0.2 px noise and 2 % outliers, at the search's start."""
    exact = rigs.random_rig(3, rigs.lopsided_camera(64, 48), kind="sheet")
    seen = rigs.with_outliers(rigs.with_noise(exact, 0.2, seed=1), 0.02, seed=2)
    width, height = seen.size
    rig = Rig(
        camera=Camera.from_model(seen.camera),
        projector=Projector(
            law=seen.projector.law, width=width, height=height, focal=Focal(),
            centre=list(seen.projector.centre), aspect=seen.projector.aspect,
        ),
    )  # fmt: skip
    map_ = CorrespondenceMap(seen.q.astype(np.float32), "sheet")
    law = seen.projector.law
    start = start_frame(map_, seen.camera, rig, law, OPTIONS)
    return separate_surfaces([map_], [start], seen.camera, make_plan(rig, 1), law, OPTIONS)


@pytest.mark.parametrize("stage", [0, 1])
def test_gradient_is_the_derivative_of_the_cost(problem_and_start, stage):
    """Oracle: central differences of the cost along random directions, both losses.

    Steps move coordinates by 1e-5 of the robust scale: the third derivative then leaves 1e-10,
    rounding of the cost 1e-7.
    """
    problem, state = problem_and_start
    objective = Objective(problem, "tukey", sigma=0.4, stage=stage)
    surfaces, globals_ = gradient(objective, state)
    rng = np.random.default_rng(0)
    for scale_surface, scale_global in ((1e-7, 0.0), (0.0, 1e-8), (1e-7, 1e-8)):
        d_rho = scale_surface * rng.standard_normal(len(state.rho[0]))
        d = scale_global * rng.standard_normal(problem.plan.columns)
        there, back = (
            objective.cost(evaluate(problem, apply_step(problem.plan, state, [s * d_rho], s * d)))
            for s in (1.0, -1.0)
        )
        assert surfaces[0] @ d_rho + globals_ @ d == pytest.approx((there - back) / 2, rel=1e-5)


def test_reaches_the_optimum_of_gauss_newton(problem_and_start):
    """Oracle: the cost at Gauss-Newton's optimum, which Adam must not exceed by more than 1 %.

    Compared under one robust scale; Gauss-Newton's optimum is below the start's cost by far more.
    """
    problem, state = problem_and_start
    newton = optimise(problem, state, OPTIONS)
    adam = optimise(problem, state, replace(OPTIONS, solver="adam"))
    assert adam.outcome == newton.outcome == Outcome.CONVERGED
    cost = newton.objective.cost
    assert cost(evaluate(problem, state)) > 1.02 * newton.cost
    assert cost(adam.evaluation) == pytest.approx(newton.cost, rel=0.01)
    assert adam.trace[-1].focal == pytest.approx(newton.trace[-1].focal, rel=1e-3)


def test_stops_at_the_limit_and_says_so(problem_and_start):
    """Oracle: two windows of 100 iterations are allowed, and far too few."""
    problem, state = problem_and_start
    optimum = optimise(problem, state, replace(OPTIONS, solver="adam", adam_iterations=200))
    assert optimum.outcome == Outcome.MAX_ITERATIONS
    assert [row.iteration for row in optimum.trace] == [100, 200]


def test_first_step_is_the_learning_rate():
    """Oracle: with bias correction Adam's first step is the sign of the gradient (2015, sec. 2)."""
    np.testing.assert_allclose(Moments(3).step(np.array([2.0, -1e-8, 0.0])), [-1, 1, 0], rtol=1e-12)

"""The first-order solver against finite differences and against Levenberg-Marquardt."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.costs.objective import evaluate, gradient
from mitsuba_endo.solve.frames.initial_poses import start_frame
from mitsuba_endo.solve.frames.separate_surfaces import separate_surfaces
from mitsuba_endo.solve.minimisers.adam import Moments
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.layout import make_layout
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
    layout = make_layout(rig, 1)
    start = start_frame(map_, seen.camera, rig, layout, law, OPTIONS)
    return separate_surfaces([map_], [start], seen.camera, rig, layout, law, OPTIONS)


@pytest.mark.parametrize("last", [False, True])
def test_gradient_is_the_derivative_of_the_cost(problem_and_start, last):
    """Oracle: central differences of the cost along random directions, both losses.

    Steps move coordinates by 1e-5 of the robust scale: the third derivative then leaves 1e-10,
    rounding of the cost 1e-7.
    """
    problem, state = problem_and_start
    noise = NoiseScale(0.4, "tukey", last=last)
    found = gradient(problem, state, noise)
    rng = np.random.default_rng(0)
    for scale_surface, scale_global in ((1e-7, 0.0), (0.0, 1e-8), (1e-7, 1e-8)):
        d_rho = scale_surface * rng.standard_normal(len(state.surfaces[0]))
        d = scale_global * rng.standard_normal(problem.layout.columns)
        there, back = (
            evaluate(problem, problem.retract(state, [s * d_rho], s * d)).cost(noise)
            for s in (1.0, -1.0)
        )
        along = found.surfaces[0] @ d_rho + found.unknowns @ d
        assert along == pytest.approx((there - back) / 2, rel=1e-5)


def test_reaches_the_optimum_of_levenberg_marquardt(problem_and_start):
    """Oracle: the cost at the other's optimum, which Adam must not exceed by more than 1 %.

    Compared under one robust scale; the other's optimum is below the start's cost by far more.
    """
    problem, state = problem_and_start
    newton = minimise(problem, state, OPTIONS)
    adam = minimise(problem, state, replace(OPTIONS, solver="adam"))
    assert adam.outcome == newton.outcome == Outcome.CONVERGED
    assert evaluate(problem, state).cost(newton.noise) > 1.02 * newton.cost
    assert adam.evaluation.cost(newton.noise) == pytest.approx(newton.cost, rel=0.01)
    assert adam.trace[-1].focal == pytest.approx(newton.trace[-1].focal, rel=1e-3)


def test_stops_at_the_limit_and_says_so(problem_and_start):
    """Oracle: two windows of 100 iterations are allowed, and far too few."""
    problem, state = problem_and_start
    result = minimise(problem, state, replace(OPTIONS, solver="adam", adam_iterations=200))
    assert result.outcome == Outcome.MAX_ITERATIONS
    assert [row.iteration for row in result.trace] == [100, 200]


def test_first_step_is_the_learning_rate():
    """Oracle: with bias correction Adam's first step is the sign of the gradient (2015, sec. 2)."""
    step = Moments.none(3).after(np.array([2.0, -1e-8, 0.0])).step
    np.testing.assert_allclose(step, [-1, 1, 0], rtol=1e-12)

"""Block jackknife where frames share a surface. Oracle: leaving every block out for good."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.solve.elimination.normal_equations import NormalEquations
from mitsuba_endo.solve.inference import jackknife
from mitsuba_endo.solve.inference.response import response
from mitsuba_endo.solve.job import Job
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.pipeline import optimise
from tests.solve.views import Views


@pytest.fixture
def result(llvm: str, three_views: Views) -> OptimisationResult:
    views = three_views
    options = Options(jackknife=False)
    job = Job(views.maps, views.camera, views.rig(), "pinhole", options)
    return optimise(job, lambda *_: None).result


def newton_step(
    result: OptimisationResult, weights: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """The step of the global unknowns with other weights, everything eliminated anew."""
    problem, at = result.problem, result.evaluation
    normal = NormalEquations.empty(problem.surfaces, problem.layout.columns)
    for k, weight in enumerate(weights):
        T = problem.layout.local_from_global(at.state, k)
        normal.add_frame(0, at.linearisation(k), at.frames[k].residual, weight, T)
    for term in problem.others:
        term.accumulate(normal, at.state, result.noise)
    reduced = normal.reduce()
    return np.linalg.solve(reduced.S, -reduced.g)


def deviations_by_leaving_out(result: OptimisationResult) -> NDArray[np.float64]:
    steps = []
    for k, frame in enumerate(result.problem.observed):
        block = jackknife.image_blocks(frame.pixels)
        for b in np.unique(block):
            weights = [w.copy() for w in result.weights]
            weights[k][block == b] = 0
            steps.append(newton_step(result, weights))
    change = np.array(steps) - np.mean(steps, axis=0)
    return np.sqrt((len(steps) - 1) / len(steps) * (change**2).sum(0))


def test_agrees_with_leaving_blocks_out(result: OptimisationResult) -> None:
    """Also where other frames see the block's vertices; the first-order answer of the surface
    makes the difference, a tenth or two."""
    normal = result.normal_equations()
    covariance, _ = jackknife.jackknives(result, normal, normal.reduce())
    assert covariance is not None
    ratio = np.sqrt(np.diag(covariance)) / deviations_by_leaving_out(result)
    assert 0.8 < np.median(ratio) < 1.1
    assert ratio.max() < 1.5
    assert ratio.min() > 0.5


def test_parts_are_positive_and_add_up(result: OptimisationResult) -> None:
    """Oracle: S less what the prior resists; no part has a negative direction."""
    normal = result.normal_equations()
    reduced = normal.reduce()
    block = normal.surfaces[0]
    X = response(reduced.factors[0], block.B, np.eye(len(reduced.g)))
    parts = [H for k in range(3) for H, _ in jackknife._block_contributions(result, k, X)]
    for H in parts:
        values = np.linalg.eigvalsh(H)
        assert values[0] > -1e-9 * values[-1]
    (smoothness,) = result.problem.smoothness
    prior = smoothness.hessian(result.state, result.noise)
    np.testing.assert_allclose(
        sum(parts) + X.T @ (prior @ X), reduced.S, rtol=1e-3, atol=1e-3 * np.abs(reduced.S).max()
    )

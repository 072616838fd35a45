"""Block jackknife where frames share a surface. Oracle: leaving every block out for good."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.solve.cost.normal import NormalEquations
from mitsuba_endo.solve.optimise.optimum import Optimum
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.pipeline import Job, search
from mitsuba_endo.solve.statistics import uncertainty
from tests.solve.views import Views


@pytest.fixture
def optimum(llvm: str, three_views: Views) -> Optimum:
    views = three_views
    options = Options(jackknife=False)
    return search(
        Job(views.maps, views.camera, views.rig(), "pinhole", options), lambda *_: None
    ).optimum


def newton_step(optimum: Optimum, weights: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The step of the global unknowns with other weights, everything eliminated anew."""
    problem, at = optimum.objective.problem, optimum.evaluation
    lattice = problem.surfaces[0].lattice
    normal = NormalEquations.empty([lattice.size], [lattice.bandwidth], problem.plan.columns)
    for k, weight in enumerate(weights):
        chart = problem.plan.local_to_global(at.state, k)
        normal.add_frame(0, at.linearisation(k), at.residuals[k], weight, chart)
    optimum.objective.add_priors(normal, at.state)
    reduced = normal.reduce()
    return np.linalg.solve(reduced.S, -reduced.g)


def deviations_by_leaving_out(optimum: Optimum) -> NDArray[np.float64]:
    steps = []
    for k, frame in enumerate(optimum.objective.problem.frames):
        block = uncertainty.image_blocks(frame.pixels, frame.shape)
        for b in np.unique(block):
            weights = [w.copy() for w in optimum.weights]
            weights[k][block == b] = 0
            steps.append(newton_step(optimum, weights))
    change = np.array(steps) - np.mean(steps, axis=0)
    return np.sqrt((len(steps) - 1) / len(steps) * (change**2).sum(0))


def test_agrees_with_leaving_blocks_out(optimum: Optimum) -> None:
    """Also where other frames see the block's vertices; the first-order answer of the surface
    makes the difference, a tenth or two."""
    normal = optimum.normal_equations()
    covariance, _ = uncertainty._jackknives(optimum, normal, normal.reduce())
    assert covariance is not None
    ratio = np.sqrt(np.diag(covariance)) / deviations_by_leaving_out(optimum)
    assert 0.8 < np.median(ratio) < 1.1
    assert ratio.max() < 1.5
    assert ratio.min() > 0.5


def test_parts_are_positive_and_add_up(optimum: Optimum) -> None:
    """Oracle: S less what the prior resists; no part has a negative direction."""
    normal = optimum.normal_equations()
    reduced = normal.reduce()
    block = normal.surfaces[0]
    X = uncertainty._response(reduced.factors[0], block.B, np.eye(len(reduced.g)))
    parts = [H for k in range(3) for H, _ in uncertainty._block_contributions(optimum, k, X)]
    for H in parts:
        values = np.linalg.eigvalsh(H)
        assert values[0] > -1e-9 * values[-1]
    surface = optimum.objective.problem.surfaces[0]
    prior = surface.prior.normal(optimum.state.rho[0], optimum.objective.sigma)[0]
    np.testing.assert_allclose(
        sum(parts) + X.T @ (prior @ X), reduced.S, rtol=1e-3, atol=1e-3 * np.abs(reduced.S).max()
    )

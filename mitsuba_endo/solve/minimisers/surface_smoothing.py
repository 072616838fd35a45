"""The surface that is reported, after the calibration.

Smoothing pulls on focal length and poses where the surface is folded, long before it spoils the
shape. So calibration uses a weak prior, and the surface is smoothed afterwards, calibration held.
"""

from dataclasses import replace

from ..costs.noise_scale import NoiseScale
from ..costs.objective import Problem, evaluate
from ..costs.smoothness import SmoothnessTerm, prior_weight
from ..options import Options
from .levenberg_marquardt import LevenbergMarquardt
from .result import OptimisationResult

_WEIGHT = 0.25
"""Weight of the reported surface's prior per observation: on random bumpy sheets and on a folded
stomach wall the shape is best between 0.1 and 0.5."""
_ITERATIONS = 10
"""Steps at most. Chosen: only the surface moves, from where a weaker prior left it."""


def smooth_surfaces(result: OptimisationResult, options: Options) -> OptimisationResult:
    """Return the result with surfaces under the prior that ``options.smoothness`` asks for.

    Outcome, noise, trace and global unknowns are those of ``result``; so are all other terms.
    """
    problem = result.problem
    smoother = [
        term.weighing(_weight(problem, term) * options.smoothness) for term in problem.smoothness
    ]
    rest = [t for t in problem.others if not isinstance(t, SmoothnessTerm)]
    surface_only = problem.with_layout(problem.layout.held(), *smoother)
    last = NoiseScale(result.noise.sigma, result.noise.last_loss, last=True)
    smoothed = LevenbergMarquardt(options.tolerance, _ITERATIONS).run(
        surface_only, result.state, last
    )
    at = evaluate(problem.with_terms(*smoother, *rest), smoothed.state)
    return replace(result, evaluation=at)


def _weight(problem: Problem, term: SmoothnessTerm) -> float:
    """Return the weight of a surface's prior, from the observations per vertex."""
    count = sum(t.observed.count for t in problem.frames if t.surface == term.index)
    return prior_weight(problem.surfaces[term.index], count, _WEIGHT)

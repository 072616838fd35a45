"""The surface that is reported, after the calibration.

Smoothing pulls on focal length and poses where the surface is folded, long before it spoils the
shape. So calibration uses a weak prior, and the surface is smoothed afterwards, calibration held.
"""

from dataclasses import replace

from ..cost.objective import Objective, evaluate
from ..cost.problem import Problem, Surface
from ..options import Options
from .gauss_newton import GaussNewton
from .optimum import Optimum, make_optimum

_WEIGHT = 0.25
"""Weight of the reported surface's prior per observation: on random bumpy sheets and on a folded
stomach wall the shape is best between 0.1 and 0.5."""
_ITERATIONS = 10


def smooth_surfaces(optimum: Optimum, options: Options) -> Optimum:
    """Return the optimum with surfaces under the prior that ``options.smoothness`` asks for.

    Outcome, noise, trace and global unknowns are those of ``optimum``.
    """
    old, problem = optimum.objective, optimum.objective.problem
    surfaces = [
        Surface(s.lattice, replace(s.prior, weight=weight * options.smoothness), s.scene)
        for s, weight in zip(problem.surfaces, _weights(problem), strict=True)
    ]
    held = replace(problem.plan, blocks=dict.fromkeys(problem.plan.blocks, "fixed"), _slots={})
    surface_only = Objective(
        Problem(problem.frames, surfaces, held, problem.law, problem.renderers), old.finish, stage=1
    )
    smoothed = GaussNewton(surface_only, options.tolerance, _ITERATIONS).run(optimum.state)
    objective = Objective(
        Problem(problem.frames, surfaces, problem.plan, problem.law, problem.renderers),
        old.finish, sigma=old.sigma, stage=old.stage,
    )  # fmt: skip
    at = evaluate(objective.problem, smoothed.state)
    return make_optimum(optimum.outcome, objective, at, optimum.trace)


def _weights(problem: Problem) -> list[float]:
    """Return the weight of every surface's prior, from the observations per vertex."""
    return [
        _WEIGHT
        * sum(f.count for k, f in enumerate(problem.frames) if problem.plan.surface_of(k) == i)
        / surface.lattice.size
        for i, surface in enumerate(problem.surfaces)
    ]

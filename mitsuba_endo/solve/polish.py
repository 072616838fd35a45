"""The surface that is reported, after the calibration.

Smoothing pulls on focal length and poses where the surface is folded, long before it spoils the
shape. So calibration uses a weak prior, and the surface is smoothed afterwards, calibration held.
"""

from dataclasses import replace

from .gauss_newton import GaussNewton
from .objective import Objective, evaluate
from .optimum import Optimum, make_optimum
from .options import Options
from .problem import Problem, Surface

REPORTED = 12.0
"""Weight of the reported surface's prior over that of the calibration."""
_ITERATIONS = 10


def smooth_surfaces(optimum: Optimum, options: Options) -> Optimum:
    """Return the optimum with surfaces under the prior that ``options.smoothness`` asks for.

    Outcome, noise, trace and global unknowns are those of ``optimum``.
    """
    old, problem = optimum.objective, optimum.objective.problem
    surfaces = [
        Surface(s.lattice, replace(s.prior, weight=s.prior.weight * REPORTED * options.smoothness),
                s.scene)
        for s in problem.surfaces
    ]  # fmt: skip
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

"""Running a solver on a prepared problem."""

import time
from collections.abc import Callable

from ..records.calibration import TraceRow
from ..records.correspondence import CorrespondenceMap
from ..records.solution import LeftOut
from .adam import Adam
from .fit import Fit
from .gauss_newton import GaussNewton
from .objective import GlobalTerm, Objective
from .optimum import Optimum
from .options import Options
from .problem import Problem
from .state import State
from .uncertainty import uncertainty

Progress = Callable[[float, str], None]
"""Called with the share of the work done and the name of the step."""
OnIteration = Callable[[TraceRow, State], None]


def optimise(
    problem: Problem,
    state: State,
    options: Options,
    extra: GlobalTerm | None = None,
    on_iteration: OnIteration | None = None,
) -> Optimum:
    """Minimise the objective from ``state`` with the solver that the options name."""
    objective = Objective(problem, options.finish, extra)
    if options.solver == "adam":
        return Adam(objective, options.adam_iterations, on_iteration).run(state)
    return GaussNewton(objective, options.tolerance, options.max_iterations, on_iteration).run(
        state
    )


def fit(
    problem: Problem,
    state: State,
    maps: list[CorrespondenceMap],
    options: Options,
    *,
    left_out: list[LeftOut] | None = None,
    notes: list[str] | None = None,
    timings: dict[str, float] | None = None,
    extra: GlobalTerm | None = None,
    on_iteration: OnIteration | None = None,
) -> Fit:
    """Optimise and compute the uncertainty; ``timings`` are those of the stages before."""
    began = time.perf_counter()
    optimum = optimise(problem, state, options, extra, on_iteration)
    solved = time.perf_counter()
    known = uncertainty(optimum, options.jackknife)
    spent = {
        **(timings or {}),
        "optimise": solved - began,
        "uncertainty": time.perf_counter() - solved,
    }
    return Fit(problem.law, maps, left_out or [], problem, optimum, known, notes or [], spent)

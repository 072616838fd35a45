"""Running a solver on a prepared problem."""

from collections.abc import Callable

from ..records.calibration import TraceRow
from .adam import Adam
from .gauss_newton import GaussNewton
from .objective import GlobalTerm, Objective
from .optimum import Optimum
from .options import Options
from .problem import Problem
from .state import State

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

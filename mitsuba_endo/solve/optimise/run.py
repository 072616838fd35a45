"""Running a solver on a prepared problem."""

from collections.abc import Callable

from ...records.calibration import TraceRow
from ..cost.objective import GlobalTerm, Objective
from ..cost.problem import Problem
from ..options import Options
from ..unknowns.state import State
from .adam import Adam
from .gauss_newton import GaussNewton
from .optimum import Optimum

Progress = Callable[[float, str], None]
"""Called with the share of the work done and the name of the step."""
OnIteration = Callable[[TraceRow, State], None]


def optimise(
    problem: Problem,
    state: State,
    options: Options,
    extra: GlobalTerm | None = None,
    on_iteration: OnIteration | None = None,
    stage: int = 0,
) -> Optimum:
    """Minimise the objective from ``state`` with the solver that the options name.

    ``stage`` is where to begin: 1 leaves out the first stage of the robust objective.
    """
    objective = Objective(problem, options.finish, extra, stage=stage)
    if options.solver == "adam":
        return Adam(objective, options.adam_iterations, on_iteration).run(state)
    return GaussNewton(objective, options.tolerance, options.max_iterations, on_iteration).run(
        state
    )

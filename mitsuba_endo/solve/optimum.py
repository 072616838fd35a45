"""Where an optimiser ended."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records.calibration import TraceRow
from ..records.solution import Outcome
from .normal import NormalEquations
from .objective import Evaluation, Objective
from .state import State


@dataclass(frozen=True, eq=False)
class Optimum:
    """The last state, with what the uncertainty needs."""

    outcome: Outcome
    objective: Objective
    evaluation: Evaluation
    weights: list[NDArray[np.float64]]
    """Robust weights (N,) of every frame."""
    normal: NormalEquations
    cost: float
    """Pattern pixels squared."""
    trace: list[TraceRow]

    @property
    def state(self) -> State:
        return self.evaluation.state


def make_optimum(
    outcome: Outcome, objective: Objective, at: Evaluation, trace: list[TraceRow]
) -> Optimum:
    """Complete an optimiser's last evaluation."""
    return Optimum(
        outcome, objective, at, objective.weights(at), objective.normal_equations(at),
        objective.cost(at), trace,
    )  # fmt: skip

"""Where an optimiser ended."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..cost.normal import NormalEquations
from ..cost.objective import Evaluation, Objective
from ..unknowns.state import State


@dataclass(frozen=True, eq=False)
class Optimum:
    """The last state, with what the uncertainty needs."""

    outcome: Outcome
    objective: Objective
    evaluation: Evaluation
    weights: list[NDArray[np.float64]]
    """Robust weights (N,) of every frame."""
    cost: float
    """Pattern pixels squared."""
    trace: list[TraceRow]

    @property
    def state(self) -> State:
        return self.evaluation.state

    def normal_equations(self) -> NormalEquations:
        """Accumulate the normal equations, which few need and nobody keeps."""
        return self.objective.normal_equations(self.evaluation)

    def support(self, frame: int) -> NDArray[np.float64]:
        """Return the robust weight (V,) of one frame's observations around every vertex."""
        problem = self.objective.problem
        lattice = problem.surfaces[problem.plan.surface_of(frame)].lattice
        of_face = np.bincount(self.evaluation.faces[frame], self.weights[frame], len(lattice.faces))
        total = np.bincount(lattice.faces.ravel(), np.repeat(of_face, 3), lattice.size)
        return total.astype(np.float64)


def make_optimum(
    outcome: Outcome, objective: Objective, at: Evaluation, trace: list[TraceRow]
) -> Optimum:
    """Complete an optimiser's last evaluation."""
    return Optimum(outcome, objective, at, objective.weights(at), objective.cost(at), trace)

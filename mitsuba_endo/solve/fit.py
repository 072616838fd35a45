"""One fit: the problem under one projector law, solved."""

from dataclasses import dataclass

from ..records.calibration import Snapshot
from ..records.correspondence import CorrespondenceMap
from ..records.solution import LeftOut
from .cost.problem import Problem
from .optimise.optimum import Optimum
from .statistics.observability import Direction
from .statistics.uncertainty import Uncertainty
from .unknowns.state import State


@dataclass(frozen=True, eq=False)
class Fit:
    """What a solver found under one law."""

    law: str
    maps: list[CorrespondenceMap]
    """The frames that are part of it."""
    left_out: list[LeftOut]
    given: list[str]
    """Names of all frames given, in order."""
    optimum: Optimum
    """The calibration."""
    reported: Optimum
    """The same with the surface smoothed as it is reported."""
    uncertainty: Uncertainty
    notes: list[str]
    """From the start: what the user should know."""
    timings: dict[str, float]
    """Seconds of every stage."""
    foreseen: list[Direction]
    """What the data were expected to leave free, before the optimisation."""
    history: list[Snapshot]
    """Coarse states from the start to the optimum."""

    @property
    def problem(self) -> Problem:
        return self.reported.objective.problem

    @property
    def state(self) -> State:
        return self.reported.state

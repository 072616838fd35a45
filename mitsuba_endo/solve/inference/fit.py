"""What solving leads to: frames solved alone, and a fit under one projection model."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import Snapshot
from ...records.correspondence import CorrespondenceMap
from ...records.solution import LeftOut
from ..costs.coordinate_residual import Observations
from ..costs.objective import Problem
from ..minimisers.result import OptimisationResult
from ..unknowns.state import State
from .covariance import Uncertainty
from .model_error.analysis import ModelCheck
from .observability import Direction


@dataclass(frozen=True, eq=False)
class FrameSolution:
    """What is kept of a frame solved alone, in units of its own baseline."""

    observations: Observations
    cell: float
    """Spacing of its surface's lattice, radians."""
    points: NDArray[np.float64]
    """(V, 3) vertices of its surface in its camera's frame."""
    state: State
    """Of it alone, without the surface."""
    squared: NDArray[np.float64]
    """(N,) squared residuals, NaN where missed."""
    used: NDArray[np.bool_]
    """(N,) correspondences that the robust loss kept."""
    information: NDArray[np.float64]
    """(G, G) about its own global unknowns, noise variances taken out."""
    range: NDArray[np.float64] | None
    """(H, W) range image of the surface as it is reported, if frames are registered by it."""
    notes: list[str]
    """From its initialisation: what the user should know."""

    @property
    def name(self) -> str:
        return self.observations.name


@dataclass(frozen=True, eq=False)
class Fit:
    """What a solver found under one projection model."""

    law: str
    maps: list[CorrespondenceMap]
    """The frames that are part of it."""
    left_out: list[LeftOut]
    given: list[str]
    """Names of all frames given, in order."""
    result: OptimisationResult
    """The calibration."""
    reported: OptimisationResult
    """The same with the surface smoothed as it is reported."""
    model: ModelCheck | None
    """What the residuals say of the model, None where that was not asked."""
    uncertainty: Uncertainty
    notes: list[str]
    """From the initialisation: what the user should know."""
    timings: dict[str, float]
    """Seconds of every stage."""
    predicted: list[Direction]
    """What the data were expected to leave free, before the optimisation."""
    history: list[Snapshot]
    """Coarse states from the start to the end."""
    refuted: str = ""
    """Why the sharing plan is wrong, where most frames contradict it."""

    @cached_property
    def estimate(self) -> State:
        """``state``, with unknowns and surfaces moved by what errors of given values did to them.

        What is rendered and compared with the maps stays at ``state``, as the given values do.
        """
        correction = None if self.model is None else self.model.correction
        if correction is None:
            return self.state
        return self.problem.retract(self.state, correction.surface_shifts, correction.shift)

    @property
    def problem(self) -> Problem:
        return self.reported.problem

    @property
    def state(self) -> State:
        return self.reported.state

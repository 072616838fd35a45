"""What one frame tells of the projector's pose in a later one: it hardly moves in its channel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.transforms import RigidTransform
from ..records.rig import Rig
from ..solve.costs.drift import step_spread
from .placement import Prior

Floats = NDArray[np.float64]

HELD = 1e-6
"""Standard deviation, radians and parts of the baseline, of a pose that all frames share."""


@dataclass(frozen=True, eq=False)
class ProjectorDrift:
    """How far the projector moves from frame to frame."""

    spread: Floats
    """(6,) standard deviation of a step: rotation vector, translation in the map's unit; infinite
    where nothing is known."""
    held: bool
    """Whether all frames share one pose."""

    @classmethod
    def of(cls, rig: Rig, baseline: float) -> "ProjectorDrift":
        """Read it from a rig.

        Args:
            rig: what is known.
            baseline: length of the first frame's, the map's unit.

        Raises:
            InputError: spreads in mm without a known baseline.
        """
        scale = np.array([1, 1, 1, baseline, baseline, baseline])
        if rig.share.projector_pose != "per_frame":
            return cls(HELD * scale, held=True)
        spread = step_spread(rig)
        return cls(np.full(6, np.inf) if spread is None else spread * scale, held=False)

    def prior(self, mean: RigidTransform, covariance: Floats, steps: int) -> Prior:
        """Return the prior ``steps`` frames after one whose pose was found.

        Args:
            mean: projector_from_camera, found.
            covariance: (6, 6) of it.
            steps: frames since.
        """
        if self.held:
            return Prior(mean, np.diag(self.spread**-2.0))
        finite = np.isfinite(self.spread)
        information = np.zeros((6, 6))
        if finite.any():
            at = np.ix_(finite, finite)
            spread = covariance[at] + steps * np.diag(self.spread[finite] ** 2)
            information[at] = np.linalg.inv(spread)
        return Prior(mean, information)

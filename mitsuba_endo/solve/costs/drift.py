"""Prior between one projector pose for all frames and an independent one for each: a random walk.

From frame to frame the projector moves by M = P_(k+1) P_k^-1, in its own axes: translation along z
is insertion, across it lateral; rotation about z is roll, of z tilt.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...geometry.transforms import RigidTransform
from ...records.rig import Rig
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .registry import register_prior
from .term import ResidualTerm

_POSE = "projector_pose"


@dataclass(frozen=True, eq=False)
class DriftTerm(ResidualTerm):
    """Steps of the projector over their spread: what the rig knows of its channel."""

    layout: Layout
    spread: NDArray[np.float64]
    """(6,) standard deviation of a step: rotation vector (radians), translation (baselines);
    infinite where nothing is known."""

    def residual(self, state: State) -> NDArray[np.float64]:
        poses = state.projector_poses
        steps = [step_between(a, b) for a, b in pairwise(poses)]
        return (np.array(steps) / self.spread).ravel()

    def depends_on(self) -> Sequence[tuple[str, int]]:
        return [(_POSE, self.layout.owner(_POSE, k)) for k in range(self.layout.frames)]


def step_between(first: RigidTransform, second: RigidTransform) -> NDArray[np.float64]:
    """Return (rotation vector, translation) of second first^-1, in the projector's axes."""
    moved = second @ first.inverse()
    return np.concatenate([Rotation.from_matrix(moved.R).as_rotvec(), moved.t])


@register_prior
def drift(rig: Rig, layout: Layout) -> DriftTerm | None:
    """Return the prior that the rig asks for, or None.

    Raises:
        InputError: spreads in mm without a known baseline.
    """
    spread = None if layout.frames < 2 else step_spread(rig)
    return None if spread is None else DriftTerm(layout, spread)


def step_spread(rig: Rig) -> NDArray[np.float64] | None:
    """Return the spread (6,) of a step as in :class:`DriftTerm`, or None where none is given.

    Raises:
        InputError: spreads in mm without a known baseline.
    """
    drift = rig.drift
    if drift is None:
        return None
    lengths = [drift.lateral_mm, drift.lateral_mm, drift.insertion_mm]
    baseline = rig.scale.baseline
    if baseline is None and any(s is not None for s in lengths):
        raise InputError(
            "spreads in mm need the unit of length, which is not known", "drift",
            "give scale.baseline or spreads in degrees only",
        )  # fmt: skip
    angles = [drift.tilt_deg, drift.tilt_deg, drift.roll_deg]
    return np.array(
        [np.inf if s is None else np.radians(s) for s in angles]
        + [np.inf if s is None or baseline is None else s / baseline for s in lengths]
    )

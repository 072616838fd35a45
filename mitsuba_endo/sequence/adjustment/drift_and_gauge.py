"""What is known beside the coordinates: how the projector drifts, and the gauge."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform
from ...solve.costs.drift import step_between
from ..projector_prior import ProjectorDrift
from .equations import FRAME
from .observations import AdjustedFrame

Floats = NDArray[np.float64]

_STEP = 1e-6
"""Of numerical derivatives, radians or the unit of length."""
_FIRM = 1e6
"""Information that holds a direction, times the mean of a projector's."""


@dataclass(frozen=True)
class Plan:
    """What is free beside the poses."""

    drift: ProjectorDrift
    focal_free: bool = True
    first_held: bool = False
    """Whether the first frame's projector stays as it is, not only the length of its baseline."""


def drift_equations(
    frames: Sequence[AdjustedFrame], drift: ProjectorDrift
) -> tuple[Floats, Floats]:
    """Return A and b of the steps that the projector made from frame to frame, over their spread.

    Args:
        frames: in order.
        drift: spread of a step, by whose root steps of several frames grow.
    """
    size = FRAME * len(frames) + 1
    A, b = np.zeros((size, size)), np.zeros(size)
    information = np.where(np.isfinite(drift.spread), drift.spread**-2.0, 0.0)
    for k, (first, second) in enumerate(pairwise(frames)):
        step_information = information / (1 if drift.held else second.number - first.number)
        step, J = _step_and_derivative(
            first.poses.projector_from_camera, second.poses.projector_from_camera
        )
        at = np.r_[FRAME * k : FRAME * k + 6, FRAME * (k + 1) : FRAME * (k + 1) + 6]
        A[np.ix_(at, at)] += J.T @ (step_information[:, None] * J)
        b[at] -= J.T @ (step_information * step)
    return A, b


def _step_and_derivative(first: RigidTransform, second: RigidTransform) -> tuple[Floats, Floats]:
    """Return the step (6,) between two poses, and its derivative (6, 12) by both."""
    step, J = step_between(first, second), np.zeros((6, 12))
    for j, nudge in enumerate(_STEP * np.eye(6)):
        J[:, j] = (step_between(first.perturbed(nudge), second) - step) / _STEP
        J[:, 6 + j] = (step_between(first, second.perturbed(nudge)) - step) / _STEP
    return step, J


def gauge(A: Floats, first: RigidTransform, plan: Plan) -> tuple[Floats, NDArray[np.bool_]]:
    """Return what holds the unit of length, to be added to A, and which unknowns are free.

    The first camera is the world, and the length of its baseline ``first.t`` the unit.
    """
    held, free = np.zeros_like(A), np.ones(len(A), bool)
    free[6:FRAME] = False
    free[:6] = not plan.first_held
    free[-1] = plan.focal_free
    along = first.t / np.linalg.norm(first.t)
    held[3:6, 3:6] = _FIRM * np.trace(A[3:6, 3:6]) * np.outer(along, along)
    return held, free

"""How far a map that grows from frame to frame may have drifted from where it began.

Each frame is placed on what some n frames before it made, and adds a share of 1 / n to what later
frames are placed on. So its own error enters the map's by 1 / n, and errors of different frames
are independent: a random walk, of which every fused frame is a step. The first frame made the map
alone: its projector's error counts whole, and that of its camera is as large as the next one's.

A map that was made with a wrong pose of the projector is bent so that later frames find the same
wrong pose. So the walk is one of both poses, and a wrong pose of the projector bends the way of the
camera (:mod:`.error_propagation`).
"""

import numpy as np
from numpy.typing import NDArray

from ..geometry.transforms import RigidTransform
from ..initialisation.vectors import skew

Floats = NDArray[np.float64]


class MapDrift:
    """Covariance of what the newest piece of the map makes frames' poses err by."""

    def __init__(self, first: Floats) -> None:
        """Begin with the covariance (6, 6) of the first frame's projector pose."""
        self._first = first
        self._covariance: Floats | None = None
        """(12, 12): step of the projector, rotation about the world's origin, shift there."""
        self._places = [np.zeros(3)]
        """Of the cameras of fused frames."""

    def fused(self, pose: RigidTransform, own: Floats, bent: Floats, reach: float) -> None:
        """Take a frame that enters the map.

        Args:
            pose: where it was placed, world_from_camera.
            own: (12, 12) covariance of its step against the map, see :func:`in_world`.
            bent: (6, 6) step of the camera, in its own axes, that a step of the projector makes on
                the way from the frame that was fused before.
            reach: how far, the map's unit, cameras may be apart that see the same surface.
        """
        near = np.linalg.norm(np.array(self._places) - pose.t, axis=1) < reach
        to_origin = _felt_at(-pose.t)
        step = to_origin @ own @ to_origin.T
        before = self._covariance
        if before is None:
            before = step.copy()
            before[:6], before[:, :6] = 0.0, 0.0
            before[:6, :6] = self._first
        transition = np.eye(12)
        transition[6:, :6] = to_origin[6:, 6:] @ np.kron(np.eye(2), pose.R) @ bent
        self._covariance = transition @ before @ transition.T + step / (near.sum() + 1) ** 2
        self._places.append(pose.t)

    def at(self, world_from_camera: RigidTransform) -> Floats:
        """Return the covariance (12, 12) of the steps of projector and camera of a frame there."""
        if self._covariance is None:
            return np.zeros((12, 12))
        moved = _felt_at(world_from_camera.t)
        return moved @ self._covariance @ moved.T


def in_world(covariance: Floats, world_from_camera: RigidTransform) -> Floats:
    """Turn the covariance (12, 12) of :meth:`Poses.moved`'s step into the world's axes."""
    turn = np.eye(12)
    turn[6:, 6:] = np.kron(np.eye(2), world_from_camera.R)
    return turn @ covariance @ turn.T


def _felt_at(t: Floats) -> Floats:
    """Return (12, 12): a rotation about the origin and a shift there, as felt at ``t``."""
    out = np.eye(12)
    out[9:, 6:9] = -skew(t)
    return out

"""An endoscope in a scene: camera and projector, and where they stand."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from .cameras import CameraModel
from .projection_models import ProjectorModel
from .transforms import RigidTransform

_ALONG_AXIS = 1e-12
"""Sine of an angle to z that is none but for rounding, and has no axis to turn about."""


@dataclass(frozen=True, eq=False)
class Endoscope:
    """Camera and projector with their poses (OpenCV axes, mm)."""

    camera: CameraModel
    world_from_camera: RigidTransform
    projector: ProjectorModel
    projector_from_camera: RigidTransform

    @property
    def world_from_projector(self) -> RigidTransform:
        return self.world_from_camera @ self.projector_from_camera.inverse()


def aimed_projector(
    centre: NDArray[np.float64], target: ArrayLike, turn: NDArray[np.float64]
) -> RigidTransform:
    """Return projector_from_camera of a projector that looks at a target.

    Args:
        centre: (3,) of the projector, mm in the camera's frame.
        target: (3,) point on its axis, mm in the camera's frame.
        turn: (3, 3) rotation of its own, which follows the smallest one that aims it.
    """
    return RigidTransform(_rotation_to(np.asarray(target) - centre) @ turn, centre).inverse()


def _rotation_to(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the smallest rotation (3, 3) that takes +z to ``axis`` (3,)."""
    unit = axis / np.linalg.norm(axis)
    about = np.cross([0.0, 0.0, 1.0], unit)
    sine = np.linalg.norm(about)
    if sine < _ALONG_AXIS:
        return np.eye(3)
    return Rotation.from_rotvec(about / sine * np.arctan2(sine, unit[2])).as_matrix()

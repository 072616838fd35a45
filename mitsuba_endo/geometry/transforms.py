"""Rigid transforms of three-dimensional space.

Names say what they do and cancel when chained:
``projector_from_world @ world_from_camera == projector_from_camera``.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """x_out = R x_in + t, an element of SE(3)."""

    R: NDArray[np.float64]
    """(3, 3) rotation."""
    t: NDArray[np.float64]
    """(3,) translation, mm."""

    @classmethod
    def identity(cls) -> Self:
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def of(cls, R: ArrayLike, t: ArrayLike) -> Self:
        """Build from anything array-like; R is a (3, 3) rotation or a (3,) rotation vector."""
        rotation = np.asarray(R, np.float64)
        if rotation.shape == (3,):
            rotation = rotation_from_vector(rotation)
        return cls(rotation.reshape(3, 3), np.asarray(t, np.float64).reshape(3))

    def __matmul__(self, other: "RigidTransform") -> "RigidTransform":
        return RigidTransform(self.R @ other.R, self.R @ other.t + self.t)

    def inverse(self) -> "RigidTransform":
        return RigidTransform(self.R.T, -self.R.T @ self.t)

    def apply(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points (..., 3)."""
        return points @ self.R.T + self.t

    def rotate(self, directions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rotate directions (..., 3)."""
        return directions @ self.R.T

    def perturbed(self, step: NDArray[np.float64]) -> "RigidTransform":
        """Return (exp([w]x) R, t + dt) for ``step`` = (w, dt), the solver's chart of SE(3)."""
        return RigidTransform(rotation_from_vector(step[:3]) @ self.R, self.t + step[3:])

    def matrix(self) -> NDArray[np.float64]:
        """Return the homogeneous 4x4 matrix."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.R, self.t
        return m


def rotation_from_vector(w: ArrayLike) -> NDArray[np.float64]:
    """Return exp([w]x) for a rotation vector (3,), radians (Rodrigues' formula)."""
    return Rotation.from_rotvec(np.asarray(w, np.float64)).as_matrix()


def rotation_angle(R: NDArray[np.float64]) -> float:
    """Return the angle of a rotation, radians, accurate near zero."""
    return float(np.linalg.norm(Rotation.from_matrix(R).as_rotvec()))


def angle_between(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the angle between two vectors (3,), radians, accurate near zero and pi."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def tangent_basis(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (3, 2) orthonormal columns perpendicular to ``direction`` (3,)."""
    d = direction / np.linalg.norm(direction)
    first = np.cross(d, np.eye(3)[np.argmin(np.abs(d))]).astype(np.float64)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(d, first)]).astype(np.float64)

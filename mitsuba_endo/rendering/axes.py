"""Mitsuba's axes and pixel positions: the only module that knows them.

Mitsuba's sensors and emitters look along +z with x to the left and y up; OpenCV's frame has x to
the right and y down. Both are right-handed, half a turn about z apart, so one function converts
either way. Mitsuba measures film and texture positions from the corner, as fractions of the size;
here an integer coordinate is a pixel centre. World coordinates are the same on both sides.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..geometry.arrays import Array
from ..geometry.transforms import RigidTransform

_HALF_TURN = np.diag([-1.0, -1.0, 1.0])
"""About z, from OpenCV's axes (x right, y down) to Mitsuba's (x left, y up)."""
_RIGID_TOLERANCE = 1e-4  # Mitsuba stores poses in single precision


def swap_axes(v: Any) -> tuple[Array, Array, Array]:
    """Return the components of a Mitsuba local vector or point in OpenCV axes, or the reverse."""
    return -v[0], -v[1], v[2]


def fraction_from_pixel(u: Array, v: Array, width: Array, height: Array) -> tuple[Array, Array]:
    """Return Mitsuba's film or texture position in [0, 1]^2 of the pixel coordinates (u, v)."""
    return (u + 0.5) / width, (v + 0.5) / height


def pixel_from_fraction(s: Array, t: Array, width: Array, height: Array) -> tuple[Array, Array]:
    """Invert :func:`fraction_from_pixel`."""
    return s * width - 0.5, t * height - 0.5


def to_world_from_pose(world_from_object: RigidTransform) -> NDArray[np.float64]:
    """Return the (4, 4) ``to_world`` matrix of a sensor or emitter with this OpenCV-axes pose."""
    m = world_from_object.matrix()
    m[:3, :3] = m[:3, :3] @ _HALF_TURN
    return m


def pose_from_to_world(matrix: ArrayLike) -> RigidTransform:
    """Return the OpenCV-axes pose ``world_from_object`` of a (4, 4) ``to_world`` matrix."""
    m = np.asarray(matrix, np.float64).reshape(4, 4)
    return RigidTransform(m[:3, :3] @ _HALF_TURN, m[:3, 3].copy())


def is_rigid(matrix: ArrayLike) -> bool:
    """Tell whether a (4, 4) matrix is a rotation and a translation, without scale or mirror."""
    R = np.asarray(matrix, np.float64).reshape(4, 4)[:3, :3]
    close = np.allclose(R @ R.T, np.eye(3), atol=_RIGID_TOLERANCE)
    return bool(close and np.linalg.det(R) > 0)

"""Signed-distance functions: smooth solids from a few rounded pieces.

A field maps points (..., 3) in mm to values (...), negative inside. Only its zero level has to
be right; away from it the values need to be roughly distances.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
_AT_CENTRE = 1e-9
"""Slope, per mm, at an ellipsoid's centre, where the first-order distance has no value."""


def ellipsoid(centre: ArrayLike, radii: ArrayLike, rotation: Rotation | None = None) -> Field:
    """Return an ellipsoid with semi-axes `radii` (3,) mm, turned by `rotation` about its centre."""
    at = np.asarray(centre, dtype=float)
    axes = np.asarray(radii, dtype=float)
    turn = np.eye(3) if rotation is None else rotation.as_matrix()

    def field(points: Array) -> Array:
        local = (points - at) @ turn  # R^T (p - c), written for row vectors
        # First-order distance |local/axes| (|local/axes| - 1) / |local/axes^2|, exact at zero.
        near = np.linalg.norm(local / axes, axis=-1)
        slope = np.linalg.norm(local / axes**2, axis=-1)
        distance = near * (near - 1) / np.maximum(slope, _AT_CENTRE)
        return np.where(slope > _AT_CENTRE, distance, -axes.min())  # the centre itself

    return field


def rounded_cone(start: ArrayLike, end: ArrayLike, radius: float, end_radius: float) -> Field:
    """Return a limb from `start` to `end` (3,) mm whose radius changes linearly between them."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)

    def field(points: Array) -> Array:
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        nearest = a + along[..., None] * (b - a)
        return np.linalg.norm(points - nearest, axis=-1) - (radius + along * (end_radius - radius))

    return field


def smooth_union(first: Array, second: Array, blend: float) -> Array:
    """Return the union of two field values with a fillet about `blend` mm wide.

    Cubic smooth minimum, twice differentiable: min(a, b) - k h^3 / 6, h = max(1 - |a - b| / k, 0).
    """
    h = np.maximum(1 - np.abs(first - second) / blend, 0)
    return np.minimum(first, second) - blend * h**3 / 6


def smooth_difference(first: Array, second: Array, blend: float) -> Array:
    """Return `first` with `second` carved out, the rim rounded over about `blend` mm."""
    return -smooth_union(-first, second, blend)


def project(field: Field, points: Array, rounds: int = 2, step: float = 1e-4) -> Array:
    """Move points (..., 3) near the surface onto it by Newton steps along the gradient.

    The gradient is a forward difference over `step` mm: it only has to aim, the value is exact.
    """
    for _ in range(rounds):
        value = field(points)
        slope = (
            np.stack([field(points + step * axis) - value for axis in np.eye(3)], axis=-1) / step
        )
        squared = np.maximum((slope**2).sum(axis=-1), 1e-6)
        points = points - (value / squared)[..., None] * slope
    return points

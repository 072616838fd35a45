"""Where a ray meets the plane of a triangle; the only place where one does."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mitsuba_modules import dr
from .moving_mesh import vector


def plane_distance(origin: Any, direction: Any, corners: Any) -> Any:
    """Return how far along ``direction`` a ray meets the plane of a triangle, in its lengths.

    s = n . (a - o) / n . w with the normal n = (b - a) x (c - a): differentiable with respect to
    everything while the triangle that is hit stays the same.
    """
    a, b, c = corners
    normal = dr.cross(b - a, c - a)
    return dr.dot(normal, a - origin) / dr.dot(normal, direction)


def distances(
    corners: NDArray[np.float64], origin: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return :func:`plane_distance` (N,) of NumPy rays to their triangles (N, 3, 3).

    Args:
        corners: of every triangle.
        origin: (3,) or (N, 3).
        directions: (N, 3).

    Returns:
        NaN where a ray is parallel to its triangle.
    """
    a, b, c = (vector(corners[:, i]) for i in range(3))
    start, direction = vector(np.broadcast_to(origin, directions.shape)), vector(directions)
    distance = plane_distance(start, direction, (a, b, c)).numpy()
    return np.where(np.isfinite(distance), distance, np.nan)

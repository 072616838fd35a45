"""Products of stacked vectors (3, N), components first: several times faster than np.cross."""

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]


def dot(a: Vectors, b: Vectors) -> Vectors:
    """Return a . b (N,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vectors, b: Vectors) -> Vectors:
    """Return a x b (3, N)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def skew(v: Vectors) -> Vectors:
    """Return [v]x (3, 3), with [v]x a = v x a."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

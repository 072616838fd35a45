"""Second differences of a triangle mesh: how much it bends across its inner edges."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def bending_operator(
    vertices: Floats, faces: NDArray[np.int64]
) -> tuple[sp.csr_array, NDArray[np.int64]]:
    """Return the bending of a mesh across its inner edges as a linear operator on positions.

    For an edge (a, b) between triangles with far corners c and d, the row is the slope towards c
    plus the slope towards d, times the mean of the two heights: the second difference over the
    edge at a spacing of one triangle. With the feet c = a + s (b - a) + ..., d likewise with t:
    K = h (w_c (x_c - (1 - s) x_a - s x_b) + w_d (x_d - (1 - t) x_a - t x_b)), w = 1 / height.
    It vanishes for every affine function over two triangles in one plane (as the quadratic
    bending energy of Bergou et al. 2006 does).

    Args:
        vertices: (V, 3).
        faces: (F, 3); edges of more than two faces are passed over.

    Returns:
        (E, V), in units of the function, and (E, 4) the corners c, d, a, b of every inner edge.
    """
    corners = _inner_edges(faces)
    c, d, a, b = (vertices[corners[:, i]] for i in range(4))
    along = b - a
    squared = np.maximum(np.einsum("ec,ec->e", along, along), 1e-300)
    s, height_c = _foot(c - a, along, squared)
    t, height_d = _foot(d - a, along, squared)
    mean = (height_c + height_d) / 2
    w_c, w_d = mean / height_c, mean / height_d
    values = np.stack([w_c, w_d, -w_c * (1 - s) - w_d * (1 - t), -w_c * s - w_d * t], axis=1)
    count = len(corners)
    operator = sp.csr_array(
        (values.ravel(), corners.ravel(), np.arange(0, 4 * count + 1, 4)),
        shape=(count, len(vertices)),
    )
    return operator, corners


def _foot(arm: Floats, along: Floats, squared: Floats) -> tuple[Floats, Floats]:
    """Return where (share of the edge) the far corner stands over it, and its height."""
    share = np.einsum("ec,ec->e", arm, along) / squared
    height = np.linalg.norm(arm - share[:, None] * along, axis=1)
    return share, np.maximum(height, 1e-6 * np.sqrt(squared))


def _inner_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (E, 4) the far corners and the ends of edges that two faces share."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    far = np.concatenate([faces[:, 2], faces[:, 0], faces[:, 1]])
    low, high = ends.min(1), ends.max(1)
    order = np.lexsort((high, low))
    low, high, far = low[order], high[order], far[order]
    new = np.flatnonzero(np.concatenate([[True], (np.diff(low) != 0) | (np.diff(high) != 0)]))
    counts = np.diff(np.concatenate([new, [len(low)]]))
    first = new[counts == 2]
    return np.stack([far[first], far[first + 1], low[first], high[first]], axis=1)

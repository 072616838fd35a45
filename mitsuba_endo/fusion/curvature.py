"""How much a mesh that is bumpy with noise bends."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .remesh import neighbours

Floats = NDArray[np.float64]


def averaging(faces: NDArray[np.int64], count: int) -> sp.csr_array:
    """Return the operator (V, V) that takes the mean over the neighbours of every vertex."""
    a, b = neighbours(faces, count)
    shares = 1 / np.bincount(a, minlength=count)[a]
    return sp.csr_array((shares, (a, b)), shape=(count, count))


def curvatures(vertices: Floats, faces: NDArray[np.int64], normals: Floats, rounds: int) -> Floats:
    """Return the curvature (V,), one over the unit of the vertices, RMS over all directions.

    How fast normals turn along edges, after averaging over neighbours. Noise of the vertices that
    averaging leaves counts as curvature.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of a mesh without unused vertices.
        normals: (V, 3) unit.
        rounds: of averaging; n of them average over about sqrt(n) edges.
    """
    a, b = neighbours(faces, len(vertices))
    mean = averaging(faces, len(vertices))
    for _ in range(rounds):
        normals = mean @ normals
        normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    turned = np.linalg.norm(normals[a] - normals[b], axis=1)
    length = np.linalg.norm(vertices[a] - vertices[b], axis=1)
    squared = np.bincount(a, (turned / length) ** 2, len(vertices))
    return np.sqrt(squared / np.bincount(a, minlength=len(vertices)))

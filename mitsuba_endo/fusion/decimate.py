"""Fewer triangles, by collapsing edges in the order of their quadric error."""

import fast_simplification
import numpy as np
from numpy.typing import NDArray

from .clean import clean

Floats = NDArray[np.float64]
Index = NDArray[np.int64]


def decimate(vertices: Floats, faces: Index, wanted: int) -> tuple[Floats, Index]:
    """Return a manifold mesh of about ``wanted`` vertices, or the same if it has no more.

    Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997, as
    fast-simplification does it.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of a manifold mesh.
        wanted: vertices to keep.

    Raises:
        ValueError: fewer than four vertices are wanted.
    """
    if wanted < 4:
        raise ValueError(f"{wanted} vertices make no surface; ask for at least 4")
    if wanted >= len(vertices):
        return vertices, faces
    # A constant origin keeps the quadrics' constant terms small, whatever the mesh's place is.
    origin = vertices.mean(0)
    target = max(4, round(len(faces) * wanted / len(vertices)))
    simple = fast_simplification.simplify(
        vertices - origin, faces.astype(np.int32), target_count=target
    )
    fewer = np.asarray(simple[0], np.float64)
    triangles, kept = clean(fewer, np.asarray(simple[1], np.int64))
    return fewer[kept] + origin, triangles

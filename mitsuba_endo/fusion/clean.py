"""Make a soup of triangles a manifold: no edge with three faces, no vertex where two fans touch."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Floats = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]


def clean(vertices: Floats, faces: Index, smallest: float = 0.0) -> tuple[Index, Index]:
    """Return a manifold mesh of the faces that are worth keeping.

    Faces without area and doubles go, then islands. Where more than two faces meet in an edge, or
    fans of faces only touch in a vertex, they are separated: the vertex is doubled.

    Args:
        vertices: (V, 3).
        faces: (F, 3).
        smallest: area of the smallest island to keep, as a share of all.

    Returns:
        The new faces (G, 3), and for each of the new vertices which old one it is (W,): the mesh is
        ``vertices[kept], faces``, and what belongs to a vertex is indexed alike.
    """
    faces = _proper(vertices, faces)
    faces, kept = _separated(vertices, faces)
    wanted = _large(vertices[kept], faces, smallest)
    faces, used = compact(faces[wanted])
    return faces, kept[used]


def areas(vertices: Floats, faces: Index) -> Floats:
    """Return the areas (F,) of faces."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def compact(faces: Index) -> tuple[Index, Index]:
    """Return faces that number only the vertices they use, and which these are (W,)."""
    used, number = np.unique(faces, return_inverse=True)
    return number.reshape(-1, 3), used


def edge_numbers(faces: Index) -> tuple[Index, Index]:
    """Return the number (F, 3) of the edge from each corner to the next, and the faces of each."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], -1), axis=-1)
    keys = ends[..., 0] * (faces.max(initial=0) + 1) + ends[..., 1]
    _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
    return number.reshape(-1, 3), count


def _proper(vertices: Floats, faces: Index) -> Index:
    """Return the faces that have an area, each once."""
    faces = faces[areas(vertices, faces) > 0]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return faces[np.sort(first)]


def _separated(vertices: Floats, faces: Index) -> tuple[Index, Index]:
    """Double vertices until every edge has one or two faces and every vertex one fan.

    Where a fan passes an edge twice doubling does not help, and its smaller faces go.
    """
    kept = np.arange(len(vertices))
    while True:
        faces, source = _one_vertex_a_fan(faces)
        kept = kept[source]
        excess = _third_faces(areas(vertices[kept], faces), faces)
        if not excess.any():
            return faces, kept
        faces = faces[~excess]


def _one_vertex_a_fan(faces: Index) -> tuple[Index, Index]:
    """Give each fan, joined by edges of just two faces of one sense, a vertex of its own.

    Returns:
        The new faces and which old vertex each new one is.
    """
    number, count = edge_numbers(faces)
    corner = np.arange(faces.size).reshape(-1, 3)
    order = np.argsort(number.ravel(), kind="stable")
    order = order[(count == 2)[number.ravel()[order]]].reshape(-1, 2)
    start, stop = corner.ravel()[order], np.roll(corner, -1, axis=1).ravel()[order]
    old = faces.ravel()
    opposite = old[start[:, 0]] == old[stop[:, 1]]
    start, stop = start[opposite], stop[opposite]
    one = np.concatenate([start[:, 0], stop[:, 0]])
    other = np.concatenate([stop[:, 1], start[:, 1]])
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(faces.size, faces.size))
    _, label = connected_components(graph, directed=False)
    _, first = np.unique(label, return_index=True)
    return label.reshape(-1, 3).astype(np.int64), old[first]


def _third_faces(area: Floats, faces: Index) -> Bools:
    """Tell which faces (F,) are not among the two largest of one of their edges."""
    number, count = edge_numbers(faces)
    if (count <= 2).all():
        return np.zeros(len(faces), bool)
    face, edge = np.repeat(np.arange(len(faces)), 3), number.ravel()
    order = np.lexsort((-area[face], edge))
    starts = np.concatenate([[0], np.cumsum(count)[:-1]])
    rank = np.arange(len(order)) - starts[edge[order]]
    excess = np.zeros(len(faces), bool)
    excess[face[order[rank >= 2]]] = True
    return excess


def _large(vertices: Floats, faces: Index, smallest: float) -> Bools:
    """Tell which faces (F,) belong to islands of at least a share of the whole area."""
    n = len(vertices)
    one, other = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    area, island = areas(vertices, faces), label[faces[:, 0]]
    total = np.bincount(island, area, label.max(initial=0) + 1)
    return total[island] >= smallest * area.sum()

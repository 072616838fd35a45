"""A mesh with edges as long as asked, place by place, and triangles nearly equilateral.

The dual of geodesic Voronoi cells on a fine mesh, whose centres move to the cells' middles, after
Valette and Chassery, "Approximated Centroidal Voronoi Diagrams for Uniform Polygonal Mesh
Coarsening", 2004. Collapsing edges (:mod:`.decimate`) keeps a finer shape with as few triangles,
but slivers, of which neighbours are numbered far apart.
"""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from .clean import areas, clean, compact, edge_numbers

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

_APART = 0.75
"""Radius that a centre keeps free, in edges: at random, centres then lie about an edge apart."""
_ROUNDS = 2
"""Times that centres move: more changes little."""


def remesh(vertices: Floats, faces: Index, edge: Floats) -> tuple[Floats, Index]:
    """Return a manifold mesh over some of the vertices, with the same border but for its teeth.

    Args:
        vertices: (V, 3) of a mesh that is finer than the edges asked for.
        faces: (F, 3) of it; what hangs together with no centre is lost.
        edge: (V,) length that edges shall have about each vertex, above zero.
    """
    lengths = _edge_lengths(vertices, faces, edge)
    # Cells of equal weight under this density have sides proportional to the edge.
    weight = np.bincount(faces.ravel(), areas(vertices, faces).repeat(3), len(vertices)) / edge**4
    border = _border(faces, len(vertices))
    centres = _spread(vertices, _APART * edge, border)
    for _ in range(_ROUNDS):
        centres = _middles(vertices, weight, _cells(lengths, centres), border)
    cell = _cells(lengths, centres)[faces]
    corners = cell[(cell >= 0).all(1) & (cell != np.roll(cell, 1, axis=1)).all(1)]
    triangles, kept = clean(vertices[centres], corners)
    triangles, used = compact(triangles[~_ears(triangles)])
    return vertices[centres[kept[used]]], triangles


def neighbours(faces: Index, count: int) -> tuple[Index, Index]:
    """Return both ends (2 E,), (2 E,) of every edge between ``count`` vertices, either way."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    once = sp.csr_array((np.ones(len(start)), (start, end)), shape=(count, count))
    first, second = (once + once.T).tocoo().coords
    return first.astype(np.int64), second.astype(np.int64)


def _ears(faces: Index) -> NDArray[np.bool_]:
    """Tell which faces (F,) hang on one other alone, so that nothing holds their far corner."""
    number, count = edge_numbers(faces)
    return (count[number] == 1).sum(1) >= 2


def _edge_lengths(vertices: Floats, faces: Index, edge: Floats) -> sp.csr_array:
    """Return the lengths (V, V) of the ways to neighbours, in edges."""
    a, b = neighbours(faces, len(vertices))
    lengths = np.linalg.norm(vertices[a] - vertices[b], axis=1) / ((edge[a] + edge[b]) / 2)
    return sp.csr_array((lengths, (a, b)), shape=(len(vertices),) * 2)


def _border(faces: Index, count: int) -> NDArray[np.bool_]:
    """Tell which of ``count`` vertices lie on an edge of one face alone."""
    number, of_edge = edge_numbers(faces)
    alone = of_edge[number] == 1
    border = np.zeros(count, bool)
    border[faces[alone]] = border[np.roll(faces, -1, axis=1)[alone]] = True
    return border


def _spread(vertices: Floats, free: Floats, first: NDArray[np.bool_]) -> Index:
    """Return vertices none of which lies within the radius (V,) of one before it, all the rest do.

    One after the other in the order of a shuffle that is always the same, ``first`` (V,) first.
    """
    tree, taken = KDTree(vertices), np.zeros(len(vertices), bool)
    order = np.random.default_rng(0).permutation(len(vertices))
    chosen = []
    for i in np.concatenate([order[first[order]], order[~first[order]]]):
        if not taken[i]:
            chosen.append(i)
            taken[tree.query_ball_point(vertices[i], free[i])] = True
    return np.array(chosen, np.int64)


def _cells(lengths: sp.csr_array, centres: Index) -> Index:
    """Return to which centre (V,) the way is shortest, -1 where none leads."""
    _, _, nearest = dijkstra(lengths, indices=centres, min_only=True, return_predecessors=True)
    number = np.full(len(nearest), -1)
    number[centres] = np.arange(len(centres))
    return np.where(nearest >= 0, number[np.maximum(nearest, 0)], -1)


def _middles(vertices: Floats, weight: Floats, cell: Index, border: NDArray[np.bool_]) -> Index:
    """Return the vertex of every cell that lies nearest to its centre of mass.

    Of a cell on the border it is one on the border, or the mesh would shrink.
    """
    member = np.flatnonzero(cell >= 0)
    cell, count = cell[member], cell.max() + 1
    total = np.bincount(cell, weight[member], count)
    mass = [np.bincount(cell, weight[member] * vertices[member, k], count) for k in range(3)]
    middle = np.stack(mass, -1) / total[:, None]
    away = ((vertices[member] - middle[cell]) ** 2).sum(1)
    order = np.lexsort((away, ~border[member], cell))
    _, first = np.unique(cell[order], return_index=True)
    return member[order[first]]

"""Meshing of a signed-distance field: naive surface nets, then relaxation on the surface.

One vertex per grid cell that the surface crosses, one quad per grid edge that it crosses
(Gibson, "Constrained Elastic Surface Nets", 1998). Unlike marching cubes this needs no table
and makes no slivers.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array

from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.sdf import Field, project

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def mesh_field(field: Field, low: ArrayLike, high: ArrayLike, cell: float) -> Mesh:
    """Mesh the zero level of `field` inside a box.

    Args:
        field: signed distance, negative inside, mm.
        low: (3,) lower corner of a box that holds the whole surface, mm.
        high: (3,) upper corner, mm.
        cell: side of a grid cell, mm; the surface must be smooth at this size.

    Returns:
        A closed mesh with outward normals, without texture coordinates. Its vertices lie on the
        field's zero level.

    Raises:
        ValueError: the surface leaves the box, there is none, or cells are too coarse to separate
            its sheets.
    """
    origin = np.asarray(low, dtype=float)
    shape = np.ceil((np.asarray(high, dtype=float) - origin) / cell).astype(int) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1)
    values = field(origin + cell * grid)
    _close_pinches(values)
    inside = values < 0
    if not inside.any():
        raise ValueError("the field has no surface inside the box")
    shell = np.ones_like(inside)
    shell[1:-1, 1:-1, 1:-1] = False
    if inside[shell].any():
        raise ValueError("the surface leaves the box")
    points, index = _cell_points(values, inside)
    quads = _quads(inside, index)
    _check_closed(quads, len(points))
    vertices = _relax(field, origin + cell * points, quads)
    return Mesh(vertices, split_quads(vertices, quads))


def _close_pinches(values: Array, rounds: int = 8) -> None:
    """Fill, in place, corners where two sheets would meet in one grid face.

    A face whose signs alternate around it lies at a saddle narrower than a cell. Counting the
    outside corner nearest to the surface as inside joins the sheets; without this four quads
    would share an edge.
    """
    for _ in range(rounds):
        mended = False
        for u, v in ((0, 1), (0, 2), (1, 2)):
            corners = []
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                pick = [slice(None)] * 3
                pick[u] = slice(du, values.shape[u] - 1 + du)
                pick[v] = slice(dv, values.shape[v] - 1 + dv)
                corners.append(values[tuple(pick)])
            a, b, c, d = (corner < 0 for corner in corners)
            saddles = np.argwhere((a == c) & (b == d) & (a != b))
            mended = mended or len(saddles) > 0
            for saddle in saddles:
                steps = np.zeros((4, 3), dtype=int)
                steps[[1, 2], u] = 1
                steps[[2, 3], v] = 1
                ring = [tuple(saddle + step) for step in steps]
                outside = [corner for corner in ring if values[corner] >= 0]
                if outside:
                    nearest = min(outside, key=lambda corner: values[corner])
                    values[nearest] = min(-values[nearest], -1e-6)
        if not mended:
            return


def _cell_points(values: Array, inside: NDArray[np.bool_]) -> tuple[Array, Index]:
    """Return (V, 3) mean edge crossings in grid units and the (cells) array of vertex indices."""
    total = np.zeros((*(n - 1 for n in values.shape), 3))
    count = np.zeros(total.shape[:3])
    for axis in range(3):
        near = [slice(None)] * 3
        far = [slice(None)] * 3
        near[axis], far[axis] = slice(None, -1), slice(1, None)
        a, b = values[tuple(near)], values[tuple(far)]
        crossed = inside[tuple(near)] != inside[tuple(far)]
        part = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)
        u, v = (other for other in range(3) if other != axis)
        for du in (0, 1):  # the cell's four edges along this axis
            for dv in (0, 1):
                pick = [slice(None)] * 3
                pick[u] = slice(du, crossed.shape[u] - 1 + du)
                pick[v] = slice(dv, crossed.shape[v] - 1 + dv)
                hit = crossed[tuple(pick)]
                count += hit
                total[..., axis] += part[tuple(pick)]
                total[..., u] += du * hit
                total[..., v] += dv * hit
    active = count > 0
    corner = np.argwhere(active)
    index = np.full(active.shape, -1, dtype=np.int64)
    index[active] = np.arange(len(corner))
    return corner + total[active] / count[active][:, None], index


def _quads(inside: NDArray[np.bool_], index: Index) -> Index:
    """Return (Q, 4) vertex indices around every crossed grid edge, outward by the right hand."""
    parts = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        order = (axis, u, v)
        here = inside.transpose(order)
        at = index.transpose(order)
        # Edges on the box's border have no surface: the outer layer is outside.
        first = here[:-1, 1:-1, 1:-1]
        crossed = first != here[1:, 1:-1, 1:-1]
        ring = [at[:, :-1, :-1], at[:, 1:, :-1], at[:, 1:, 1:], at[:, :-1, 1:]]
        quads = np.stack([part[crossed] for part in ring], axis=1)
        leaving = first[crossed]  # inside to outside along +axis: the ring is counter-clockwise
        parts.append(np.where(leaving[:, None], quads, quads[:, ::-1]))
    return np.concatenate(parts)


def _check_closed(quads: Index, count: int) -> None:
    """Refuse a surface in which an edge does not join exactly two quads.

    Two sheets that pass through one cell share its only vertex, and then touch there.
    """
    i, j = quads.ravel(), np.roll(quads, -1, axis=1).ravel()
    edges = np.minimum(i, j) * count + np.maximum(i, j)
    if (np.unique(edges, return_counts=True)[1] != 2).any():
        raise ValueError("two sheets of the surface pass through one cell")


def _relax(field: Field, points: Array, quads: Index, rounds: int = 3) -> Array:
    """Even out the vertices: move each half-way to its neighbours' mean, then to the surface."""
    i = quads.ravel()
    j = np.roll(quads, -1, axis=1).ravel()
    ones = np.ones(2 * len(i))
    pairs = (np.concatenate([i, j]), np.concatenate([j, i]))
    near = coo_array((ones, pairs), shape=(len(points), len(points))).tocsr()
    degree = near.sum(axis=1)[:, None]
    for _ in range(rounds):
        points = project(field, 0.5 * points + 0.5 * (near @ points) / degree, rounds=1)
    return project(field, points)


def split_quads(vertices: Array, quads: Index) -> Index:
    """Cut quads (Q, 4) into two triangles each (2 Q, 3) along their shorter diagonals."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    first = np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1)
    turned = np.where(first[:, None], quads, np.roll(quads, -1, axis=1))
    return np.concatenate([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])

"""Surfaces made of a grid of vertices: sample positions, faces, texture coordinates."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.mesh import Mesh

MAX_TRIANGLES = 4_000_000
"""Above this a mesh is refused: it is a mistaken unit far more often than a wish."""

Array = NDArray[np.float64]


def cells(length: float, edge: float) -> int:
    """Return how many grid cells of about `edge` mm cover `length` mm (at least two)."""
    return max(2, round(length / edge))


def check_size(triangles: float, where: str) -> None:
    """Refuse a mesh too large to be meant.

    Raises:
        InputError: more than `MAX_TRIANGLES`.
    """
    if triangles > MAX_TRIANGLES:
        raise InputError(
            f"the mesh would have {triangles:.2g} triangles, more than {MAX_TRIANGLES:.0g}",
            where=f"{where}: edge",
            todo="choose a longer edge, in mm",
        )


def grid_axes(width: float, height: float, edge: float, where: str) -> tuple[Array, Array]:
    """Return (R, C) arrays of x and y, centred on zero; columns run along x, rows along y, mm."""
    check_size(2 * width * height / edge**2, where)
    x = np.linspace(-width / 2, width / 2, cells(width, edge) + 1)
    y = np.linspace(-height / 2, height / 2, cells(height, edge) + 1)
    return tuple(np.meshgrid(x, y))  # pyright: ignore[reportReturnType]


def grid_faces(rows: int, columns: int, wrap: bool = False) -> NDArray[np.int64]:
    """Return (F, 3) faces of a grid whose vertex (row, column) has index row * columns + column.

    The normal is (row direction) x (column direction): -z where columns run along x and rows
    along y. With `wrap` the last column is joined to the first.
    """
    index = np.arange(rows * columns, dtype=np.int64).reshape(rows, columns)
    if wrap:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, :-1].ravel(), index[1:, 1:].ravel()
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def grid_uv(rows: int, columns: int) -> Array:
    """Return (rows * columns, 2): u grows along the columns, v along the rows, both in [0, 1]."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    return np.stack([u.ravel(), v.ravel()], axis=1)


def planar_uv(vertices: Array) -> Array:
    """Return (V, 2): x and y of the vertices (V, 3) scaled to [0, 1] (a slide projection)."""
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    return np.clip((vertices[:, :2] - low) / (high - low), 0, 1)


def grid_mesh(points: Array) -> Mesh:
    """Return the mesh of an open grid of points (R, C, 3)."""
    rows, columns = points.shape[:2]
    return Mesh(points.reshape(-1, 3), grid_faces(rows, columns), grid_uv(rows, columns))


def heightfield(
    depth: Callable[[Array, Array], Array], width: float, height: float, edge: float, where: str
) -> Mesh:
    """Return the sheet z = depth(x, y) over a centred width x height rectangle, all in mm.

    `where` names the shape in an error message.
    """
    x, y = grid_axes(width, height, edge, where)
    return grid_mesh(np.stack([x, y, depth(x, y)], axis=-1))


def sphere_patch(angle_x: float, angle_y: float, edge_angle: float) -> tuple[Array, Array]:
    """Sample a four-sided piece of the unit sphere around +z.

    Grid lines lie at equal angles a (about y) and b (about x); the direction is
    (tan a, tan b, 1) normalised, so there is no pole and cells are nearly square. The solid
    angle is 4 asin(sin angle_x * sin angle_y).

    Args:
        angle_x: half-angle from left to right, rad.
        angle_y: half-angle from top to bottom, rad.
        edge_angle: angle between neighbouring vertices, rad.

    Returns:
        Directions (R, C, 3) and the angles (a, b) of each (R, C, 2).
    """
    a = np.linspace(-angle_x, angle_x, cells(2 * angle_x, edge_angle) + 1)
    b = np.linspace(-angle_y, angle_y, cells(2 * angle_y, edge_angle) + 1)
    angles = np.stack(np.meshgrid(a, b), axis=-1)
    rays = np.concatenate([np.tan(angles), np.ones_like(angles[..., :1])], axis=-1)
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True), angles

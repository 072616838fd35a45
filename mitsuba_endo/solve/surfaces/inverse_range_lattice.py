"""A lattice of inverse ranges as the surface: vertices that slide along fixed directions.

Directions from one centre (the first camera's) lie on a square lattice of the equidistant map
(a, b) = theta (cos phi, sin phi), theta being the angle to the z axis; it covers an image of any
field of view and the wall of a lumen around the camera alike. The unknown is the inverse range
rho = 1 / |X| of every vertex, in which correspondences are nearly linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy import ndimage

from ...rendering.mitsuba_modules import dr, mi
from ...rendering.moving_mesh import vector
from .registry import register_surface
from .surface import Bending, Surface

_OFFSET = np.array([0.381966, 0.276393])
"""Shift of the lattice in cells: edges through the optical axis would meet whole lines of pixel
rays, and a ray along an edge can slip between two triangles."""
_FARTHEST = 20.0
"""Farthest range of a vertex, in medians: an outlier may push it there but not behind us."""
_STEEP = 4.0
"""Rise of the range over the cell's width, the tangent of 76 degrees, from which on a triangle
may be the bridge over a depth step."""


@register_surface
@dataclass(frozen=True, eq=False)
class Lattice(Surface):
    """A triangulated set of directions; X_i = directions_i / rho_i."""

    kind = "lattice"
    cell: float
    """Lattice spacing, radians."""
    ij: NDArray[np.int64]
    """(V, 2) lattice indices (column, row) of the vertices, sorted along the short side."""
    faces: NDArray[np.int64]
    """(F, 3) vertex indices, seen from the centre in clockwise order."""

    @property
    def size(self) -> int:
        """Number of vertices."""
        return len(self.ij)

    def record(self) -> dict[str, NDArray]:
        return {"cell": np.array(self.cell), "ij": self.ij, "faces": self.faces}

    @classmethod
    def from_record(cls, arrays: Mapping[str, NDArray]) -> "Lattice":
        return cls(float(arrays["cell"]), arrays["ij"], arrays["faces"])

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """(V, 2) equidistant coordinates (a, b), radians."""
        return ((self.ij + _OFFSET) * self.cell).astype(np.float64)

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """(V, 3) unit directions."""
        return equidistant_direction(self.coordinates)

    def vertices(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (V, 3) vertex positions for inverse ranges (V,)."""
        return self.directions / values[:, None]

    def slopes(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return 1 / values**2  # of a standard deviation: the sign is free

    def retract(
        self, values: NDArray[np.float64], step: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.maximum(values + step, np.median(values) / _FARTHEST)

    def corners(self, vertex: Any, value: Any, active: Any) -> Any:
        return dr.gather(mi.Vector3d, self._directions, vertex, active) / value

    def bending(self, disparity: float) -> Bending:
        return Bending((self.second_differences() * disparity).tocsr())

    def bridges(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        range_ = 1 / values[self.faces]
        return np.ptp(range_, axis=1) > _STEEP * self.cell * range_.mean(1)

    def is_centre(self, point: NDArray[np.float64]) -> bool:
        return not point.any()

    def typical_range(self, values: NDArray[np.float64]) -> float:
        return 1 / float(np.median(values))

    def coarsened(self, room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return every n-th vertex; a coarse square is covered where its four corners exist."""
        step = max(1, int(np.ceil(np.sqrt(self.size / room))))
        low = self.ij.min(0)
        kept = np.flatnonzero(((self.ij - low) % step == 0).all(1))
        column, row = ((self.ij[kept] - low) // step).T
        index = np.full((row.max() + 2, column.max() + 2), -1)
        index[row, column] = np.arange(len(kept))
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
        whole = (a >= 0) & (b >= 0) & (c >= 0) & (d >= 0)
        a, b, c, d = (corner[whole] for corner in (a, b, c, d))
        return kept, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])

    @cached_property
    def _directions(self) -> Any:
        return vector(self.directions)

    def second_differences(self) -> sp.csr_array:
        """Return the (M, V) operator rho_before - 2 rho + rho_after along both lattice axes."""
        index = self._index()
        rows = []
        for before, middle, after in (
            (index[:, :-2], index[:, 1:-1], index[:, 2:]),
            (index[:-2], index[1:-1], index[2:]),
        ):
            complete = (before >= 0) & (middle >= 0) & (after >= 0)
            rows.append(np.stack([before[complete], middle[complete], after[complete]], 1))
        triples = np.concatenate(rows)
        values = np.tile([1.0, -2.0, 1.0], len(triples))
        pointers = np.arange(0, 3 * len(triples) + 1, 3)
        return sp.csr_array((values, triples.ravel(), pointers), (len(triples), self.size))

    def nearest(self, directions: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the index of the vertex nearest to each direction (N, 3), -1 where none is."""
        index = self._index()
        at = np.round(lattice_position(directions, self.cell)).astype(np.int64)
        column, row = (at - self.ij.min(0)).T
        inside = (column >= 0) & (row >= 0) & (column < index.shape[1]) & (row < index.shape[0])
        return np.where(inside, index[np.where(inside, row, 0), np.where(inside, column, 0)], -1)

    def fill(self, covered: NDArray[np.bool_], rho: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give vertices that are not ``covered`` (V,) the inverse range of the nearest that is."""
        index = self._index()
        covered_grid = np.zeros(index.shape, bool)
        covered_grid[self._place_in_index()] = covered
        nearest = np.empty((2, *covered_grid.shape), np.int32)
        ndimage.distance_transform_edt(
            ~covered_grid, return_distances=False, return_indices=True, indices=nearest
        )
        row, column = self._place_in_index()
        return rho[index[nearest[0, row, column], nearest[1, row, column]]]

    def _place_in_index(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        low = self.ij.min(0)
        return self.ij[:, 1] - low[1], self.ij[:, 0] - low[0]

    def _index(self) -> NDArray[np.int64]:
        """Return the (rows, columns) image of vertex indices, -1 where there is none."""
        index = np.full(np.ptp(self.ij, axis=0)[::-1] + 1, -1)
        index[self._place_in_index()] = np.arange(self.size)
        return index


def lattice_over(directions: NDArray[np.float64], cell: float, margin: int = 1) -> Lattice:
    """Build the lattice whose cells hold ``directions`` (N, 3), grown by ``margin`` cells.

    Args:
        directions: unit vectors that the surface must cover.
        cell: lattice spacing, radians.
        margin: cells added around, held by smoothness alone.
    """
    ij = np.floor(lattice_position(directions, cell)).astype(np.int64)
    low = ij.min(0) - margin
    columns, rows = np.ptp(ij, axis=0) + 1 + 2 * margin
    cells = np.zeros((int(rows), int(columns)), bool)
    cells[ij[:, 1] - low[1], ij[:, 0] - low[0]] = True
    if margin:
        grown = ndimage.binary_dilation(cells, np.ones((3, 3)), iterations=margin)
        cells = np.asarray(grown, bool)
    nodes = np.zeros((int(rows) + 1, int(columns) + 1), bool)
    for dy in (0, 1):
        for dx in (0, 1):
            nodes[dy : dy + int(rows), dx : dx + int(columns)] |= cells
    # Numbering along the short side keeps the normal matrix's band narrow.
    transpose = nodes.shape[0] < nodes.shape[1]
    order = np.argwhere(nodes.T if transpose else nodes).astype(np.int64)
    row_column = order[:, ::-1] if transpose else order
    index = np.full(nodes.shape, -1)
    index[tuple(row_column.T)] = np.arange(len(row_column))
    return Lattice(cell, row_column[:, ::-1] + low, _triangulate(index, cells))


def _triangulate(index: NDArray[np.int64], cells: NDArray[np.bool_]) -> NDArray[np.int64]:
    a, b = index[:-1, :-1][cells], index[:-1, 1:][cells]
    c, d = index[1:, :-1][cells], index[1:, 1:][cells]
    return np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])


def lattice_position(directions: NDArray[np.float64], cell: float) -> NDArray[np.float64]:
    """Return where unit directions (..., 3) lie on a lattice, in cells (..., 2)."""
    return equidistant_coordinates(directions) / cell - _OFFSET


def equidistant_coordinates(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map unit directions (..., 3) to equidistant coordinates (..., 2), radians."""
    x, y, z = np.moveaxis(directions, -1, 0)
    r = np.hypot(x, y)
    scale = np.where(r > 0, np.arctan2(r, z) / np.where(r > 0, r, 1.0), 1.0)
    return np.stack([scale * x, scale * y], -1)


def equidistant_direction(ab: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map equidistant coordinates (..., 2), radians, to unit directions (..., 3)."""
    theta = np.linalg.norm(ab, axis=-1)
    return np.concatenate([np.sinc(theta / np.pi)[..., None] * ab, np.cos(theta)[..., None]], -1)

"""The surface as the solver sees it: vertices that slide along fixed directions.

Directions from one centre (the first camera's) lie on a square lattice of the equidistant map
(a, b) = theta (cos phi, sin phi), theta being the angle to the z axis; it covers an image of any
field of view and the wall of a lumen around the camera alike. The unknown is the inverse range
rho = 1 / |X| of every vertex, in which correspondences are nearly linear.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy import ndimage

_OFFSET = np.array([0.381966, 0.276393])
"""Shift of the lattice in cells: edges through the optical axis would meet whole lines of pixel
rays, and a ray along an edge can slip between two triangles."""


@dataclass(frozen=True, eq=False)
class FacePattern:
    """Sparse (V, V) matrix that couples the vertices of every face."""

    indices: NDArray[np.int32]
    """Columns, as in ``csr_array``."""
    indptr: NDArray[np.int32]
    positions: NDArray[np.int64]
    """(F, 3, 3) place in the matrix's data of each pair of a face's vertices."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """A triangulated set of directions; X_i = directions_i / rho_i."""

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

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """(V, 2) equidistant coordinates (a, b), radians."""
        return ((self.ij + _OFFSET) * self.cell).astype(np.float64)

    @property
    def directions(self) -> NDArray[np.float64]:
        """(V, 3) unit directions."""
        return equidistant_direction(self.coordinates)

    def vertices(self, rho: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (V, 3) vertex positions for inverse ranges (V,)."""
        return self.directions / rho[:, None]

    @cached_property
    def bandwidth(self) -> int:
        """Largest difference of indices that the smoothness couples."""
        triples = self.second_differences().indices.reshape(-1, 3)
        faces = np.ptp(self.faces, axis=1).max(initial=1)
        return int(max(np.ptp(triples, axis=1).max(initial=1), faces))

    @cached_property
    def face_pattern(self) -> FacePattern:
        """Which entries of a normal matrix the observations fill."""
        rows = np.broadcast_to(self.faces[:, :, None], (len(self.faces), 3, 3))
        columns = np.broadcast_to(self.faces[:, None, :], rows.shape)
        key, positions = np.unique(rows * self.size + columns, return_inverse=True)
        row, column = np.divmod(key, self.size)
        counts = np.bincount(row, minlength=self.size)
        indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        return FacePattern(column.astype(np.int32), indptr, positions.reshape(rows.shape))

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

    def fill(self, seen: NDArray[np.bool_], rho: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give vertices that are not ``seen`` (V,) the inverse range of the nearest seen one."""
        index = self._index()
        known = np.zeros(index.shape, bool)
        known[self._place()] = seen
        nearest = np.empty((2, *known.shape), np.int32)
        ndimage.distance_transform_edt(
            ~known, return_distances=False, return_indices=True, indices=nearest
        )
        row, column = self._place()
        return rho[index[nearest[0, row, column], nearest[1, row, column]]]

    def _place(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        low = self.ij.min(0)
        return self.ij[:, 1] - low[1], self.ij[:, 0] - low[0]

    def _index(self) -> NDArray[np.int64]:
        """Return the (rows, columns) image of vertex indices, -1 where there is none."""
        index = np.full(np.ptp(self.ij, axis=0)[::-1] + 1, -1)
        index[self._place()] = np.arange(self.size)
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

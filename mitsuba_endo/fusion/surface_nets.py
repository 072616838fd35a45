"""Meshing of a volume's zero level by naive surface nets, block by block.

One vertex per cell of eight voxels that the surface crosses, one quad per edge of the grid that
it crosses (Gibson, "Constrained Elastic Surface Nets", 1998), as :mod:`mitsuba_endo.shapes` does
it for closed solids on a dense grid. Here voxels may be unseen, so that the surface may end.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..shapes.surface_nets import split_quads
from .blocks import SIDE, BlockIndex
from .grid import CORNERS, Grid, close_pinches
from .tsdf import Volume

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

LEAP = 2.5
"""Voxels that a distance may change by along an edge of the grid. Its slope is one; where it is
far more, the two ends were seen on different sheets and nothing was seen between them."""
_EDGES = [(i, j) for i in range(8) for j in range(i) if np.abs(CORNERS[i] - CORNERS[j]).sum() == 1]
"""Pairs of corners that an edge of a cell joins."""


@dataclass(frozen=True, eq=False)
class RawSurface:
    """A mesh as fine as the voxels, not yet cleaned."""

    vertices: Floats
    """(V, 3), world."""
    faces: Index
    """(F, 3), counter-clockwise seen from the cameras' side."""
    frames: Index
    """(V,) how many frames measured the surface here."""
    weight: Floats
    """(V,) sum of the frames' weights."""
    scatter: Floats
    """(V,) weighted sum of squares of their distances about the mean, squares of the unit."""


def extract(volume: Volume) -> RawSurface:
    """Mesh the surface that a volume holds; it ends where nothing was seen."""
    grid = Grid.of(volume)
    close_pinches(grid)
    numbering = np.full(grid.distance.shape, -1, np.int32)
    parts: list[tuple[NDArray, ...]] = []
    count = 0
    for slots in grid.chunks():
        block, *cell = _crossed(grid, slots)
        numbering[slots[block], *cell] = count + np.arange(len(block))
        parts.append(_vertices(volume, grid, slots[block], np.stack(cell, -1)))
        count += len(block)
    quads = _quads(grid, numbering)
    if not parts:
        parts = [(np.empty((0, 3)), *[np.empty(0)] * 3)]
    vertices, frames, weight, scatter = (np.concatenate(p) for p in zip(*parts, strict=True))
    return RawSurface(
        vertices, split_quads(vertices, quads), frames.astype(np.int64), weight, scatter
    )


def _crossed(grid: Grid, slots: Index) -> tuple[Index, ...]:
    """Return (block, x, y, z) of the cells that the surface crosses."""
    beyond = grid.with_next(slots)
    corners = [beyond[:, x : x + SIDE, y : y + SIDE, z : z + SIDE] for x, y, z in CORNERS.tolist()]
    with np.errstate(invalid="ignore"):
        lowest, highest = (f.reduce(corners) for f in (np.minimum, np.maximum))
        crossed = (lowest < 0) & (highest >= 0)  # NaN at any corner: neither
        for i, j in _EDGES:
            crossed &= np.abs(corners[i] - corners[j]) <= LEAP
    return np.nonzero(crossed)


def _vertices(volume: Volume, grid: Grid, slots: Index, cell: Index) -> tuple[NDArray, ...]:
    """Return the vertices (N, 3) of cells (N, 3) of blocks (N,), and what was seen of each.

    The mean of the points where the surface crosses the cell's edges, then one Newton step to
    the zero of the trilinear interpolation, along its gradient.
    """
    corner_slots, *xyz = _corner_voxels(volume.index, slots, cell)
    within = np.ravel_multi_index(xyz, (SIDE,) * 3)
    value = grid.distance[corner_slots, *xyz].astype(float)
    at = _newton(value, _crossing_mean(value))
    vertices = (volume.index.places[slots] * SIDE + cell + at) * volume.voxel
    counted = volume.frames(corner_slots, within).max(1)
    weight, scatter = volume.weight(corner_slots, within), volume.scatter(corner_slots, within)
    return vertices, counted, weight.mean(1), scatter.mean(1) * volume.voxel**2


def _corner_voxels(index: BlockIndex, slots: Index, cell: Index) -> tuple[Index, ...]:
    """Return the slots and the places x, y, z in the block (N, 8) of the corners of cells."""
    corner = cell[:, None] + CORNERS
    beyond = corner // SIDE
    corner_slots = index.find(index.places[slots][:, None] + beyond)
    return corner_slots, *np.moveaxis(corner - beyond * SIDE, -1, 0)


def _crossing_mean(value: Floats) -> Floats:
    """Return the mean (N, 3) of the zeros on the edges of cells with corner values (N, 8)."""
    total, count = np.zeros((len(value), 3)), np.zeros((len(value), 1))
    for i, j in _EDGES:
        a, b = value[:, [i]], value[:, [j]]
        crossed = (a < 0) != (b < 0)
        part = np.where(crossed, a / np.where(crossed, a - b, 1), 0)
        total += np.where(crossed, CORNERS[i] + part * (CORNERS[j] - CORNERS[i]), 0)
        count += crossed
    return total / count


def _newton(value: Floats, at: Floats) -> Floats:
    """Move points (N, 3) of cells to the zero of the trilinear interpolation, within the cell."""
    shares = np.where(CORNERS, at[:, None], 1 - at[:, None])  # (N, 8, 3)
    level = np.sum(value * shares.prod(-1), axis=1)
    gradient = np.stack([_slope(value, shares, axis) for axis in range(3)], -1)
    squared = np.maximum(np.sum(gradient**2, axis=1), 0.05)
    return np.clip(at - (level / squared)[:, None] * gradient, 0, 1)


def _slope(value: Floats, shares: Floats, axis: int) -> Floats:
    others = [k for k in range(3) if k != axis]
    sign = np.where(CORNERS[:, axis], 1.0, -1.0)
    return np.sum(value * sign * shares[..., others].prod(-1), axis=1)


def _quads(grid: Grid, numbering: NDArray[np.int32]) -> Index:
    """Return (Q, 4) vertices around every edge of the grid with a vertex in all its four cells."""
    quads = [np.empty((0, 4), np.int64)]
    for slots in grid.chunks():
        distance, number = grid.with_next(slots), grid.with_previous(slots, numbering)
        quads += [_quads_along(axis, distance, number) for axis in range(3)]
    return np.concatenate(quads)


def _quads_along(axis: int, distance: NDArray[np.float32], number: NDArray[np.int32]) -> Index:
    """Return the quads of edges along an axis, towards the positive side by the right hand."""
    order = (0, 1 + axis, 1 + (axis + 1) % 3, 1 + (axis + 2) % 3)
    value, at = distance.transpose(order), number.transpose(order)
    first, last = value[:, :-1, :-1, :-1], value[:, 1:, :-1, :-1]
    ring = [at[:, 1:, :-1, :-1], at[:, 1:, 1:, :-1], at[:, 1:, 1:, 1:], at[:, 1:, :-1, 1:]]
    with np.errstate(invalid="ignore"):
        crossed = (first < 0) != (last < 0)
    crossed &= (
        np.isfinite(first) & np.isfinite(last) & np.logical_and.reduce([r >= 0 for r in ring])
    )
    quads = np.stack([r[crossed] for r in ring], axis=1).astype(np.int64)
    rising = first[crossed] < 0
    return np.where(rising[:, None], quads, quads[:, ::-1])

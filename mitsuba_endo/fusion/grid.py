"""Signed distances in blocks, as one grid: each block with the layer of voxels beside it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import SIDE, BlockIndex
from .tsdf import Volume

Floats = NDArray[np.float32]
Index = NDArray[np.int64]

CHUNK = 4096
"""Blocks worked on at once: some 60 MB."""
CORNERS = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(-1, 3)
"""(8, 3) of a unit cube."""
_ROUNDS = 8
"""Passes at most, since filling a corner may pinch a face beside it. Chosen."""


@dataclass(frozen=True, eq=False)
class Grid:
    """A copy of a volume's distances, which may be changed."""

    index: BlockIndex
    distance: Floats
    """(N, 4, 4, 4), voxels, positive on the cameras' side; NaN where unseen."""

    @classmethod
    def of(cls, volume: Volume) -> "Grid":
        distance = volume.distance(np.arange(len(volume.index)))
        return cls(volume.index, distance.reshape(-1, SIDE, SIDE, SIDE))

    def chunks(self) -> Iterator[Index]:
        """Yield the slots of all blocks, a few at a time."""
        for start in range(0, len(self.index), CHUNK):
            yield np.arange(start, min(start + CHUNK, len(self.index)))

    def with_next(self, slots: Index) -> Floats:
        """Return the distances (M, 5, 5, 5) of blocks and of the first layer beyond them."""
        beyond = np.full((len(slots), *[SIDE + 1] * 3), np.nan, np.float32)
        for corner, there, neighbour in self._beside(slots, 1):
            into = tuple(slice(SIDE, None) if c else slice(0, SIDE) for c in corner)
            of = tuple(slice(0, 1) if c else slice(0, SIDE) for c in corner)
            beyond[there, *into] = self.distance[neighbour][:, *of]
        return beyond

    def with_previous(self, slots: Index, numbering: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return numbers (M, 5, 5, 5) of the last layer before blocks and of the blocks, or -1.

        Args:
            slots: (M,) of the blocks.
            numbering: (N, 4, 4, 4) of all blocks' voxels.
        """
        before = np.full((len(slots), *[SIDE + 1] * 3), -1, np.int32)
        for corner, there, neighbour in self._beside(slots, -1):
            into = tuple(slice(0, 1) if c else slice(1, None) for c in corner)
            of = tuple(slice(SIDE - 1, None) if c else slice(0, SIDE) for c in corner)
            before[there, *into] = numbering[neighbour][:, *of]
        return before

    def _beside(self, slots: Index, step: int) -> Iterator[tuple[list[int], Index, Index]]:
        """Yield, for each corner, which blocks have a neighbour there, and its slot."""
        for corner in CORNERS.tolist():
            neighbour = self.index.find(self.index.places[slots] + step * np.array(corner))
            there = np.flatnonzero(neighbour >= 0)
            yield corner, there, neighbour[there]


def close_pinches(grid: Grid) -> None:
    """Fill, in place, voxels where two sheets would meet in one face of the grid.

    A face whose signs alternate around it lies at a saddle narrower than a voxel, and four quads
    would share an edge there. Counting the seen side's corner nearest to the surface as behind it
    joins the sheets, as :mod:`mitsuba_endo.shapes.surface_nets` does it.
    """
    for _ in range(_ROUNDS):
        pinched = [_pinched(grid, slots, axis) for slots in grid.chunks() for axis in range(3)]
        block, *voxel = np.concatenate([np.empty((0, 4), np.int64), *pinched]).T
        if not len(block):
            return
        value = grid.distance[block, *voxel]
        grid.distance[block, *voxel] = np.minimum(-value, np.float32(-1e-6))


def _pinched(grid: Grid, slots: Index, axis: int) -> Index:
    """Return (K, 4) block, x, y, z of the corners to fill of pinched faces across an axis."""
    u, v = (other for other in range(3) if other != axis)
    ring = np.zeros((4, 3), np.int64)
    ring[[1, 2], u], ring[[2, 3], v] = 1, 1
    beyond = grid.with_next(slots)
    corners = np.stack(
        [beyond[:, x : x + SIDE, y : y + SIDE, z : z + SIDE] for x, y, z in ring.tolist()]
    )
    behind = corners < 0
    alternate = (behind[0] == behind[2]) & (behind[1] == behind[3]) & (behind[0] != behind[1])
    block, *cell = np.nonzero(alternate & np.isfinite(corners).all(0))
    values = corners[:, block, *cell]
    nearest = np.where(values >= 0, values, np.inf).argmin(0)
    at = np.stack(cell, -1) + ring[nearest]
    blocks = grid.index.places[slots[block]] + at // SIDE
    return np.column_stack([grid.index.find(blocks), at % SIDE])

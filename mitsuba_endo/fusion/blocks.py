"""A sparse grid: cubes of voxels, kept only where there is something."""

import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]

SIDE = 4
"""Voxels along the side of a block."""
_HALF_SPAN = 1 << 20
"""Blocks to either side of the origin that a key can tell: three times 21 bits."""


class BlockIndex:
    """Finds the slot of a block by its place. Slots are numbered as blocks are added."""

    def __init__(self) -> None:
        self._keys = np.empty(0, np.int64)
        """Sorted."""
        self._slots = np.empty(0, np.int64)
        """Of each key."""
        self.places = np.empty((0, 3), np.int64)
        """(N, 3) integer coordinates of the blocks, in the order of the slots."""

    def __len__(self) -> int:
        return len(self.places)

    def find(self, blocks: Index) -> Index:
        """Return the slots of blocks (..., 3), -1 for those that are not there."""
        if not len(self):
            return np.full(blocks.shape[:-1], -1)
        wanted = keys_of(blocks)
        at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
        return np.where(self._keys[at] == wanted, self._slots[at], -1)

    def add(self, blocks: Index) -> Index:
        """Return the slots of distinct blocks (M, 3), adding those that are not there."""
        missing = blocks[self.find(blocks) < 0]
        keys = np.concatenate([self._keys, keys_of(missing)])
        slots = np.concatenate([self._slots, len(self) + np.arange(len(missing))])
        order = np.argsort(keys, kind="stable")
        self._keys, self._slots = keys[order], slots[order]
        self.places = np.concatenate([self.places, missing])
        return self.find(blocks)


def keys_of(coordinates: Index) -> Index:
    """Pack integer coordinates (..., 3) into one number each.

    Raises:
        ValueError: a coordinate is more than a million from the origin.
    """
    if coordinates.size and np.abs(coordinates).max() >= _HALF_SPAN:
        raise ValueError("the surface is too large for its voxels; choose larger voxels")
    x, y, z = np.moveaxis(coordinates + _HALF_SPAN, -1, 0)
    return (x << 42) | (y << 21) | z


def places_of(keys: Index) -> Index:
    """Unpack numbers of :func:`keys_of` into coordinates (..., 3)."""
    parts = [(keys >> shift) & (2 * _HALF_SPAN - 1) for shift in (42, 21, 0)]
    return np.stack(parts, -1) - _HALF_SPAN


def blocks_near(points: NDArray[np.float64], block: float) -> Index:
    """Return the distinct blocks (M, 3) that hold points (N, 3), and those around them."""
    held = np.unique(keys_of(np.floor(points / block).astype(np.int64)))
    steps = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), -1).reshape(-1, 3)
    return places_of(np.unique(keys_of(places_of(held)[:, None] + steps)))

"""The signed distance between a volume's voxels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import SIDE
from .grid import CORNERS
from .tsdf import Volume

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Interpolated:
    """What a volume holds at points of the world."""

    observed: NDArray[np.bool_]
    """(N,) whether all eight voxels around the point were seen."""
    distance: Floats
    """(N,) to the surface, positive on the cameras' side, the unit of the voxels' side; else 0."""
    gradient: Floats
    """(N, 3) of it with respect to the point; else 0."""


def interpolate(volume: Volume, points: Floats) -> Interpolated:
    """Interpolate the signed distance linearly along each axis.

    Args:
        volume: the surface.
        points: (N, 3) in the world.
    """
    at = points / volume.voxel
    cell = np.floor(at).astype(np.int64)
    value = _corner_values(volume, cell)
    observed = np.asarray(np.isfinite(value).all(0))
    value = np.where(observed, value, 0.0)
    share = (at - cell).T
    # Halves the corners axis by axis: x is the slowest in CORNERS, z the fastest.
    along_x = value[4:] - value[:4]
    plane = value[:4] + share[0] * along_x
    along_y = plane[2:] - plane[:2]
    line = plane[:2] + share[1] * along_y
    slope_x = _linear(_linear(along_x, share[1]), share[2])[0]
    slope_y = _linear(along_y, share[2])[0]
    slope_z = line[1] - line[0]
    distance = line[0] + share[2] * slope_z
    return Interpolated(
        observed, volume.voxel * distance, np.stack([slope_x, slope_y, slope_z], -1)
    )


def _linear(values: Floats, share: Floats) -> Floats:
    """Interpolate the first half of ``values`` (2 K, N) towards the second."""
    half = len(values) // 2
    return values[:half] + share * (values[half:] - values[:half])


def _corner_values(volume: Volume, cell: NDArray[np.int64]) -> Floats:
    """Return (8, N) distances at the corners of cells (N, 3), voxels; NaN where unseen."""
    out = np.full((len(CORNERS), len(cell)), np.nan)
    for value, corner in zip(out, CORNERS, strict=True):
        voxel = cell + corner
        block = voxel // SIDE
        slot = volume.index.find(block)
        there = slot >= 0
        x, y, z = (voxel - SIDE * block)[there].T
        value[there] = volume.distance(slot[there], (x * SIDE + y) * SIDE + z)
    return out

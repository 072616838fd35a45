"""A truncated signed distance, averaged over range images, in blocks near the surface.

Curless and Levoy, "A Volumetric Method for Building Complex Models from Range Images", 1996: each
voxel averages its signed distance to the surfaces seen, positive on the cameras' side. Distances
are those along the ray times the cosine of incidence, that is to the surface's tangent plane:
views at any slant agree about a plane.
"""

import numpy as np
from numpy.typing import NDArray

from .blocks import SIDE, BlockIndex, blocks_near
from .frame import RangeFrame

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

TRUNCATION = float(SIDE)
"""Voxels to either side of the surface that are kept; no more than a block."""
LONGEST = 3.0
"""Truncations along the ray, above which a voxel is too far from where a slanted wall was met."""
FADE = 1.0
"""Voxels behind the surface at which the weight begins to fade: nothing was seen there."""
CHUNK = 2048
"""Blocks worked on at once: some 30 MB."""
_WITHIN = np.indices((SIDE,) * 3).reshape(3, -1).T.astype(np.float64)
"""(64, 3) places of a block's voxels, as they are numbered."""


class Volume:
    """Sums over the frames integrated so far; memory grows with the surface, not with frames.

    The order of the frames changes nothing but the rounding: a frame touches only blocks near the
    surface that it saw itself.
    """

    def __init__(self, voxel: float) -> None:
        """Begin with nothing.

        Args:
            voxel: side of a voxel, the unit of the ranges.
        """
        if not (np.isfinite(voxel) and voxel > 0):
            raise ValueError(f"the side of a voxel is {voxel}; it must be above zero")
        self.voxel = float(voxel)
        self.index = BlockIndex()
        self._sums = np.zeros((0, SIDE**3, 3), np.float32)
        """Of the weights, and of the weighted distances in voxels and their squares."""
        self._count = np.zeros((0, SIDE**3), np.uint16)
        """Frames."""

    def integrate(self, frame: RangeFrame) -> None:
        """Add what one frame saw."""
        blocks = blocks_near(_samples(frame, self.voxel * SIDE / 2), self.voxel * SIDE)
        slots = self.index.add(blocks)
        self._reserve(len(self.index))
        for start in range(0, len(slots), CHUNK):
            self._add(frame, slots[start : start + CHUNK])

    @property
    def bytes(self) -> int:
        """Memory held."""
        return self._sums.nbytes + self._count.nbytes

    def distance(self, *at: Index) -> NDArray[np.float32]:
        """Return signed distances, voxels; NaN where unseen.

        Args:
            at: slots of blocks (M,), for all their voxels (M, 64); or slots and numbers of voxels
                in them, for these alone.
        """
        weight, first = self._sums[*at, ..., 0], self._sums[*at, ..., 1]
        observed = weight > 0
        return np.where(observed, first / np.where(observed, weight, 1), np.float32(np.nan))

    def weight(self, *at: Index) -> NDArray[np.float32]:
        """Return sums of weights, as :meth:`distance`."""
        return self._sums[*at, ..., 0]

    def scatter(self, *at: Index) -> NDArray[np.float32]:
        """Return weighted sums of squares about the mean, voxels^2, as :meth:`distance`."""
        weight, first, second = np.moveaxis(self._sums[*at, ..., :], -1, 0)
        return np.maximum(second - first**2 / np.where(weight > 0, weight, 1), 0)

    def frames(self, *at: Index) -> NDArray[np.uint16]:
        """Return how many frames saw the surface near, as :meth:`distance`."""
        return self._count[*at]

    def _reserve(self, blocks: int) -> None:
        if blocks > len(self._sums):
            more = max(blocks, len(self._sums) * 5 // 4) - len(self._sums)
            self._sums = np.concatenate([self._sums, np.zeros((more, SIDE**3, 3), np.float32)])
            self._count = np.concatenate([self._count, np.zeros((more, SIDE**3), np.uint16)])

    def _add(self, frame: RangeFrame, slots: Index) -> None:
        camera_from_world = frame.world_from_camera.inverse()
        blocks = self.index.places[slots].astype(np.float64)
        corners = camera_from_world.apply(blocks * (SIDE * self.voxel))
        within = camera_from_world.rotate(_WITHIN * self.voxel)
        at = (corners.T[:, :, None] + within.T[:, None]).reshape(3, -1)
        which, distance, weight = _measure(frame, at, self.voxel)
        block, voxel = slots[which // SIDE**3], which % SIDE**3
        parts = np.stack([weight, weight * distance, weight * distance**2], -1)
        self._sums[block, voxel] += parts.astype(np.float32)
        self._count[block, voxel] += 1


def _measure(frame: RangeFrame, at: Floats, voxel: float) -> tuple[Index, Floats, Floats]:
    """Measure points (3, N) of the camera's frame against the surface that it saw.

    Returns:
        Which points (M,) are near it, their signed distances, voxels, and their weights.
    """
    which, row, column, x, y = _locate(frame, at)
    away = np.sqrt(np.einsum("kn,kn->n", at[:, which], at[:, which]))
    cells = frame.cells
    above = _between(frame.inverse_range, row, column, x)
    below = _between(frame.inverse_range, row + 1, column, x)
    along = (1 / (above * (1 - y) + below * y) - away) / voxel
    cosine = cells.cosine[row, column]
    distance = along * cosine
    near = (np.abs(distance) < TRUNCATION) & (np.abs(along) < LONGEST * TRUNCATION)
    fade = np.minimum((TRUNCATION + distance) / (TRUNCATION - FADE), 1)
    weight = cells.weight[row, column] * cosine * fade
    near &= weight > 0
    return which[near], distance[near], weight[near]


def _locate(frame: RangeFrame, at: Floats) -> tuple[Index, Index, Index, Floats, Floats]:
    """Return which points (3, N) lie in smooth cells, their cells' rows and columns, and where.

    A lens model folds back far outside the image, and some project what is behind: a point counts
    only where its pixel's ray leads to it.
    """
    with np.errstate(all="ignore"):
        u, v = (np.asarray(c, np.float64) for c in frame.camera.project_xyz(*at))
        inside = (u >= 0) & (v >= 0) & (u < frame.camera.width - 1) & (v < frame.camera.height - 1)
    which = np.flatnonzero(inside)
    which = which[frame.cells.smooth[v[which].astype(int), u[which].astype(int)]]
    column, row = u[which].astype(np.int64), v[which].astype(np.int64)
    ray, points = frame.camera.grid_rays[row, column], at[:, which]
    along = np.einsum("nk,kn->n", ray, points)
    led = along > frame.cells.cone[row, column] * np.sqrt((points**2).sum(0))
    which, row, column = which[led], row[led], column[led]
    return which, row, column, u[which] - column, v[which] - row


def _between(values: Floats, row: Index, column: Index, part: Floats) -> Floats:
    """Return linear interpolations (N,) between neighbours of a row."""
    return values[row, column] * (1 - part) + values[row, column + 1] * part


def _samples(frame: RangeFrame, spacing: float) -> Floats:
    """Return points (N, 3) in the world so dense that one is within ``spacing`` of all the surface.

    A steep wall's pixels lie far apart: their cells are divided as often as need be.
    """
    points = frame.camera.grid_rays / frame.inverse_range[..., None]
    smooth = frame.cells.smooth
    corners = [points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]]
    a, b, c, d = (corner[smooth] for corner in corners)
    longest = np.maximum(np.linalg.norm(a - d, axis=1), np.linalg.norm(b - c, axis=1))
    pieces = np.ceil(longest / spacing).astype(int)
    parts = [
        _divided([corner[pieces == n] for corner in (a, b, c, d)], n) for n in np.unique(pieces)
    ]
    return frame.world_from_camera.apply(np.concatenate([np.empty((0, 3)), *parts]))


def _divided(corners: list[Floats], pieces: int) -> Floats:
    """Return the bilinear points (N, 3) of cells at the middles of ``pieces`` x ``pieces``."""
    middles = (np.arange(pieces) + 0.5) / pieces
    x, y = (p.ravel()[:, None, None] for p in np.meshgrid(middles, middles))
    a, b, c, d = corners
    return ((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)).reshape(-1, 3)

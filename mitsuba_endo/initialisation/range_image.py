"""Range images and the coarser point-and-normal images that registration works on."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel

Floats = NDArray[np.float64]

MIN_COSINE = 0.12
"""Surface seen more obliquely than this (83 degrees) is taken for a depth edge."""
MAX_SPREAD = 0.08
"""Standard deviation over mean of the ranges in one block: above, it lies across a depth edge."""
COARSE_COLUMNS, FINE_COLUMNS = 54, 110
"""Columns to which images are averaged."""
MIN_POINTS = 50
"""An image with fewer usable points is not worth trying."""


@dataclass(frozen=True, eq=False)
class RangeImage:
    """What one camera sees of a surface, in a unit of length of its own."""

    rays: Floats
    """(H, W, 3) unit directions of the pixels in the camera frame."""
    range: Floats
    """(H, W) distance along the rays, NaN = not seen."""
    camera: CameraModel
    """Projects points of the camera frame into this image."""


@dataclass(frozen=True, eq=False)
class Level:
    """A range image averaged over blocks of pixels, as oriented points."""

    camera: CameraModel
    block: int
    """Side of a block, pixels of the full image."""
    shape: tuple[int, int]
    """Rows and columns of blocks."""
    slot: NDArray[np.int32]
    """(rows * columns + 1,) index into ``points`` of a block, ``len(points)`` if not usable; the
    last entry stands for everything outside the image."""
    points: Floats
    """(N + 1, 3) in the camera frame, in the unit asked for; the last one is a placeholder."""
    normals: Floats
    """(N + 1, 3) unit, towards the camera; zero for the placeholder."""
    weights: Floats
    """(N + 1,) 1 / noise relative to a point at unit range; zero for the placeholder."""

    @property
    def size(self) -> int:
        """Number of usable points."""
        return len(self.points) - 1

    def look_up(self, points: Floats) -> NDArray[np.int32]:
        """Return the index of the point seen in the direction of each of ``points`` (..., 3)."""
        with np.errstate(all="ignore"):
            u, v = self.camera.project_xyz(points[..., 0], points[..., 1], points[..., 2])
            # Full-image pixel (integer = centre) to block.
            column, row = np.floor((u + 0.5) / self.block), np.floor((v + 0.5) / self.block)
            rows, columns = self.shape
            inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            block = np.where(inside, row * columns + column, rows * columns)
        return self.slot[block.astype(np.int32)]


@dataclass(frozen=True, eq=False)
class RangePyramid:
    """A range image in the common unit of all frames, and its levels, made when asked for."""

    image: RangeImage
    unit: float
    """Length that counts as 1, in the image's own unit."""

    @cached_property
    def coarse(self) -> Level:
        return self._level(COARSE_COLUMNS)

    @cached_property
    def fine(self) -> Level:
        return self._level(FINE_COLUMNS)

    def _level(self, columns: int) -> Level:
        return make_level(self.image, max(1, round(self.image.range.shape[1] / columns)), self.unit)

    @property
    def usable(self) -> bool:
        return min(self.coarse.size, self.fine.size) >= MIN_POINTS


def typical_range(image: RangeImage) -> float:
    """Return the median range; NaN for an empty image."""
    ranges = image.range[np.isfinite(image.range)]
    return float(np.median(ranges)) if ranges.size else float("nan")


def make_level(image: RangeImage, block: int, unit: float) -> Level:
    """Average ``image`` over blocks of ``block`` x ``block`` pixels, in ``unit``, with normals.

    Noise of a triangulated range grows with its square, and that of a point's distance from a plane
    also with the cosine between ray and normal, which the weights undo.
    """
    mean = _block_means(image, unit, block)
    normal = _normals(mean)
    distance = np.linalg.norm(mean, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = -(normal * mean).sum(-1) / distance
        usable = cosine > MIN_COSINE
        weight = 1 / np.clip(distance**2, 0.2, 5.0)
    slot = np.full(usable.size + 1, int(usable.sum()), np.int32)
    slot[:-1][usable.ravel()] = np.arange(usable.sum())
    return Level(
        image.camera, block, (usable.shape[0], usable.shape[1]), slot,
        _with_placeholder(mean[usable]),
        _with_placeholder(normal[usable]),
        _with_placeholder(weight[usable]),
    )  # fmt: skip


def _block_means(image: RangeImage, unit: float, block: int) -> Floats:
    """Return the mean points (rows, columns, 3) of blocks in ``unit``; NaN if half is missing."""
    rows, columns = image.range.shape[0] // block, image.range.shape[1] // block
    crop = (slice(rows * block), slice(columns * block))
    ranges = image.range[crop] / unit
    valid = np.isfinite(ranges) & (ranges > 0)
    ranges = np.where(valid, ranges, 0.0)
    stacked = np.concatenate(
        [
            image.rays[crop] * ranges[..., None],
            np.stack([valid, ranges, ranges * ranges], -1, dtype=np.float64),
        ],
        axis=-1,
    )
    # OpenCV's area interpolation by a whole factor is the mean over blocks.
    mean = cv2.resize(stacked, (columns, rows), interpolation=cv2.INTER_AREA)
    share = mean[..., 3]
    with np.errstate(invalid="ignore", divide="ignore"):
        points = np.asarray(mean[..., :3] / share[..., None], np.float64)
        first, second = mean[..., 4] / share, mean[..., 5] / share
        spread = np.sqrt(np.maximum(second - first * first, 0)) / first
        points[~((share >= 0.5) & (spread < MAX_SPREAD))] = np.nan
    return points


def _normals(points: Floats) -> Floats:
    """Return unit normals (H, W, 3) towards the camera; NaN where a 3x3 neighbour is missing."""
    across = cv2.Sobel(points, cv2.CV_64F, 1, 0, ksize=3, borderType=cv2.BORDER_REPLICATE)
    down = cv2.Sobel(points, cv2.CV_64F, 0, 1, ksize=3, borderType=cv2.BORDER_REPLICATE)
    n = np.cross(down, across).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return n / np.linalg.norm(n, axis=-1, keepdims=True)


def _with_placeholder(values: Floats) -> Floats:
    return np.concatenate([values, np.zeros((1, *values.shape[1:]))])

"""Less noise where the network is less sure: each place is drawn towards a plane fitted around."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .nodes import larger

WIDTH = 4.0
"""Standard deviation of the fit's window, pixels: under half a period."""
UNSURE = (0.7, 0.95)
"""Confidence from which down the plane alone counts, and from which up the pixel alone."""
MAX_REST = 0.3
"""Periods, standard deviation, that the window may leave off the plane: more is a fold."""
MAX_CHANGE = 0.25
"""Periods by which a plane may change a pixel."""
RIDGE = 1e-3
"""Share of the window's variance that steadies slopes where pixels are few."""


def drawn_to_planes(
    lattice: NDArray[np.float32], confidence: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return column and row (H, W, 2) with less noise; NaN stays NaN.

    A plane is fitted to the known pixels around each, weighted by a Gaussian window and by the
    square of the confidence (local linear regression; W. Cleveland and S. Devlin, "Locally weighted
    regression", 1988).

    Args:
        lattice: (H, W, 2) column and row; NaN where not known.
        confidence: (H, W) probability that the network's phase is right.
    """
    known = np.isfinite(lattice[..., 0])
    weight = np.where(known, confidence**2, 0).astype(np.float32)
    sure, alone = UNSURE
    share = np.where(known, np.clip((alone - confidence) / (alone - sure), 0, 1), 0)
    values = np.where(known[..., None], lattice, 0)
    planes, rest = _planes(values, weight)
    change = planes - values
    share[(larger(change) > MAX_CHANGE) | (rest > MAX_REST)] = 0
    return (lattice + share[..., None] * change).astype(np.float32)


def _planes(
    values: NDArray[np.float32], weight: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the plane's value (H, W, 2) at each pixel, and the larger standard deviation off it.

    The second one is (H, W), over both axes.
    """
    total = np.maximum(_moment(weight, 0, 0), np.float32(1e-6))
    x, y = _moment(weight, 1, 0) / total, _moment(weight, 0, 1) / total
    ridge = np.float32(RIDGE * WIDTH**2)
    xx = _moment(weight, 2, 0) / total - x * x + ridge
    yy = _moment(weight, 0, 2) / total - y * y + ridge
    xy = _moment(weight, 1, 1) / total - x * y
    determinant = xx * yy - xy * xy
    planes, rests = [], []
    for k in (0, 1):
        value = np.ascontiguousarray(values[..., k])
        weighted = weight * value
        mean = _moment(weighted, 0, 0) / total
        by_x = _moment(weighted, 1, 0) / total - x * mean
        by_y = _moment(weighted, 0, 1) / total - y * mean
        slope_x = (yy * by_x - xy * by_y) / determinant
        slope_y = (xx * by_y - xy * by_x) / determinant
        planes.append(mean - slope_x * x - slope_y * y)
        variance = _moment(weighted * value, 0, 0) / total - mean * mean
        rests.append(variance - slope_x * by_x - slope_y * by_y)
    rest = np.sqrt(np.maximum(np.maximum(*rests), 0))
    return np.stack(planes, -1), rest


def _moment(image: NDArray[np.float32], of_x: int, of_y: int) -> NDArray[np.float32]:
    """Return the sums (H, W) over the window of image dx^of_x dy^of_y."""
    away = np.arange(-np.ceil(2.5 * WIDTH), np.ceil(2.5 * WIDTH) + 1)
    window = np.exp(-0.5 * (away / WIDTH) ** 2)
    window /= window.sum()
    across, down = (window * away**power for power in (of_x, of_y))
    border = cv2.BORDER_CONSTANT
    sums = cv2.sepFilter2D(image, cv2.CV_32F, across, down, borderType=border)
    return np.asarray(sums, np.float32)

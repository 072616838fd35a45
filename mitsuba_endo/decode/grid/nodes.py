"""Nodes of the grid: where both phases are zero, to a fraction of a pixel."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from .heads import Heads

MIN_CONFIDENCE = 0.3
"""Lower than a pixel's: what a node is told by its links as well."""
REACH = 0.75
"""Pixels from a node's place to the nearest pixel's middle, with room for the slope's error."""
SPACING = 5
"""Of several candidates in a window of so many pixels the best is taken."""
PERIOD = (3.0, 60.0)
"""Pixels a period may take in the image."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """N nodes of an image."""

    at: NDArray[np.float64]
    """(N, 2) image pixels (x, y)."""
    slope: NDArray[np.float64]
    """(N, 2, 2) derivative of the place in the grid (periods) by that in the image (pixels)."""
    code: NDArray[np.float64]
    """(N, 3) probabilities of R, S, L."""

    def __len__(self) -> int:
        return len(self.at)

    @property
    def pixel(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column of each node's pixel."""
        nearest = np.rint(self.at).astype(np.intp)
        return nearest[:, 1], nearest[:, 0]


def wrapped(periods: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the values modulo one, in [-1/2, 1/2]."""
    return periods - np.rint(periods)


def larger(pairs: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the larger absolute value of pairs (..., 2).

    NumPy reduces a last axis of length two far more slowly.
    """
    return np.maximum(np.abs(pairs[..., 0]), np.abs(pairs[..., 1]))


def find_nodes(heads: Heads) -> Nodes:
    """Return the zeros of both phases where the network is confident.

    Each pixel takes one Newton step with the slope around it; where the step stays within the
    pixel, it ends at a node.
    """
    phase = heads.phase
    slope = phase_slope(phase)
    inverse, regular = _inverse(slope)
    step = -np.einsum("hwij,hwj->hwi", inverse, phase)
    size = larger(step)
    # Beyond a quarter of a period the zero may be that of a neighbouring node.
    good = regular & (heads.confidence > MIN_CONFIDENCE) & (larger(phase) < 0.25)
    size = np.where(good, size, np.inf)
    y, x = np.nonzero((size <= REACH) & (size == minimum_filter(size, SPACING)))
    shape = np.array(size.shape[::-1])
    at = np.clip(np.stack([x, y], -1) + step[y, x], 0, shape - 1)
    code = cv2.blur(heads.code.transpose(1, 2, 0), (3, 3))
    return Nodes(at, slope[y, x].astype(np.float64), code[y, x].astype(np.float64))


def phase_slope(phase: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the derivative (H, W, 2, 2) of the wrapped phase by x and y, averaged over 5 x 5."""
    padded = np.pad(phase, ((1, 1), (1, 1), (0, 0)), mode="edge")
    by_x = wrapped(padded[1:-1, 2:] - padded[1:-1, :-2]) / 2
    by_y = wrapped(padded[2:, 1:-1] - padded[:-2, 1:-1]) / 2
    mean = [cv2.blur(np.ascontiguousarray(d, np.float32), (5, 5)) for d in (by_x, by_y)]
    return np.stack(mean, -1).astype(np.float32)


def _inverse(
    slope: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the inverse (H, W, 2, 2), pixels per period, and where it is that of a grid.

    A surface is seen from its lit side, so the image never shows the grid mirrored.
    """
    a, b, c, d = (slope[..., i, j] for i in (0, 1) for j in (0, 1))
    determinant = a * d - b * c
    regular = determinant > 1 / PERIOD[1] ** 2
    safe = np.where(regular, determinant, 1)
    inverse = np.stack([d, -b, -c, a], -1).reshape(*slope.shape) / safe[..., None, None]
    for period in (np.hypot(inverse[..., 0, k], inverse[..., 1, k]) for k in (0, 1)):
        regular &= (period > PERIOD[0]) & (period < PERIOD[1])
    return inverse.astype(np.float32), regular

"""Cells of the grid: regions of pixels within which the phase does not wrap.

A cell holds one node, to which its pixels belong; between neighbouring cells the phase wraps, so
the place of one tells that of the other.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .nodes import larger

SMOOTH = 0.3
"""Periods by which the phase may differ between neighbouring pixels of one surface."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of an image and the pairs of pixels on their borders."""

    number: NDArray[np.int32]
    """(H, W) cell of each pixel, 0 = none."""
    count: int
    """Cells, with 0."""
    first: NDArray[np.intp]
    """(P,) flat index of a pixel."""
    second: NDArray[np.intp]
    """(P,) flat index of its right or lower neighbour in another cell."""
    step: NDArray[np.intp]
    """(P, 2) place of the second pixel's node less that of the first's."""


def find_cells(phase: NDArray[np.float32], usable: NDArray[np.bool_]) -> Cells:
    """Label the cells of a phase (H, W, 2), periods, among the usable pixels."""
    height, width = usable.shape
    # Pixels lie at even places, links between neighbours at the odd places between them.
    mask = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    mask[::2, ::2] = usable
    index = np.arange(usable.size).reshape(height, width)
    borders = []
    for axis, linked in ((1, mask[::2, 1::2]), (0, mask[1::2, ::2])):
        ahead = (slice(None), slice(1, None)) if axis else (slice(1, None), slice(None))
        behind = (slice(None), slice(-1)) if axis else (slice(-1), slice(None))
        difference = phase[ahead] - phase[behind]
        wraps = np.rint(difference)
        smooth = (larger(difference - wraps) < SMOOTH) & usable[ahead] & usable[behind]
        within = larger(wraps) == 0
        linked[:] = smooth & within
        border = smooth & ~within
        borders.append((index[behind][border], index[ahead][border], -wraps[border]))
    count, label = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
    first, second, step = (np.concatenate(parts) for parts in zip(*borders, strict=True))
    number = np.ascontiguousarray(label[::2, ::2], dtype=np.int32)
    return Cells(number, count, first, second, step.astype(np.intp))

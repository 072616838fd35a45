"""How much wider poses scatter than they would if errors of pixels were independent."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from .placement import Placement

Floats = NDArray[np.float64]

FRAMES = 40
"""Frames over which the ratio is taken: one frame's blocks tell it to a third only."""


class SharedErrors:
    """Ratio of variances from blocks of the image to those of white noise, unknown by unknown."""

    def __init__(self) -> None:
        self._ratios: deque[Floats] = deque(maxlen=FRAMES)

    def widened(self, placement: Placement) -> Floats:
        """Return the covariance (12, 12) of a placed frame, errors that pixels share included."""
        self._ratios.append(np.diag(placement.clustered) / np.diag(placement.covariance))
        factor = np.sqrt(np.maximum(np.mean(self._ratios, axis=0), 1.0))
        return factor[:, None] * placement.covariance * factor

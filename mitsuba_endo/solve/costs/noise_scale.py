"""The noise of one coordinate, and the scale of the robust loss that follows it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .robust_loss import LOSSES, Loss

Floats = NDArray[np.float64]

STEADY = 0.98
"""A scale that falls to no less than this share of itself in an iteration has settled. Chosen."""
_MEDIAN_RADIUS = 1.1774100225154747
"""Median length of a two-dimensional standard normal vector, sqrt(2 ln 2)."""
_SMALLEST_NOISE = 1e-4
"""Floor of the noise estimate, pattern pixels: the precision of a float32 map."""


@dataclass(frozen=True)
class NoiseScale:
    """Noise of one coordinate and the robust loss that goes with it, in two stages.

    First the published Cauchy loss, whose scale falls with the residuals; then, with the noise
    fixed, the loss that ends the optimisation.
    """

    sigma: float
    """Pattern pixels."""
    last_loss: str
    """Name in :data:`LOSSES` of the last stage's loss."""
    last: bool = False
    """Whether this is the last stage."""

    @property
    def loss(self) -> Loss:
        return LOSSES[self.last_loss if self.last else "cauchy"]

    @property
    def scale(self) -> float:
        """Scale of the robust loss, pattern pixels."""
        return self.loss.efficient_scale * self.sigma

    def followed(self, estimate: float) -> "NoiseScale":
        """Return the scale after it has followed an estimate of the noise downwards."""
        return self if self.last else replace(self, sigma=min(estimate, self.sigma))

    def final(self, estimate: float) -> "NoiseScale":
        """Return the last stage's, with an estimate of the noise."""
        return replace(self, sigma=estimate, last=True)

    def at(self, sigma: float) -> "NoiseScale":
        """Return the same loss for another noise."""
        return replace(self, sigma=sigma)


def robust_noise(squared: Floats) -> float:
    """Return the standard deviation of one component, from squared lengths (N,), NaN = none."""
    squared = squared[np.isfinite(squared)]
    if not len(squared):
        return _SMALLEST_NOISE
    return max(float(np.sqrt(np.median(squared))) / _MEDIAN_RADIUS, _SMALLEST_NOISE)

"""Robust losses of the squared residual, as iteratively reweighted least squares needs them.

``loss(r2, c)`` is half the squared residual for small residuals, in pattern pixels squared;
``weight`` is its derivative with respect to r2 / 2. c is the scale in pattern pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.arrays import Array, namespace

STEADY = 0.98
"""A scale that falls to no less than this share of itself in an iteration has settled. Chosen."""


@dataclass(frozen=True)
class Loss:
    """A robust loss; formulas run on NumPy and Dr.Jit arrays alike."""

    name: str
    loss: Callable[[Array, float, Callable[[Array], Array]], Array]
    weight: Callable[[Array, float], Array]
    efficient_scale: float
    """c / sigma at which two-dimensional Gaussian residuals lose at most 5 % of information."""

    def __call__(self, r2: Array, c: float, log: Callable[[Array], Array] = np.log1p) -> Array:
        return self.loss(r2, c, log)


def _tukey(r2: Array, c: float, _log: Callable[[Array], Array]) -> Array:
    rest = 1 - r2 / (c * c)
    inside = namespace(r2).where(rest > 0, rest, 0.0)
    return c * c / 6 * (1 - inside * inside * inside)


def _tukey_weight(r2: Array, c: float) -> Array:
    rest = 1 - r2 / (c * c)
    inside = namespace(r2).where(rest > 0, rest, 0.0)
    return inside * inside


LOSSES = {
    # The published loss: c^2 / 2 log(1 + r^2 / c^2).
    "cauchy": Loss(
        "cauchy",
        lambda r2, c, log: c * c / 2 * log(r2 / (c * c)),
        lambda r2, c: 1 / (1 + r2 / (c * c)),
        efficient_scale=3.5,
    ),
    # Biweight, redescending: ends the optimisation, since Cauchy leaves a bias under many outliers.
    "tukey": Loss("tukey", _tukey, _tukey_weight, efficient_scale=6.5),
}


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

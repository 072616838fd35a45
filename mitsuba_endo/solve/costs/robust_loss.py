"""Robust losses of the squared residual, as iteratively reweighted least squares needs them.

``loss(r2, c)`` is half the squared residual for small residuals, in pattern pixels squared;
``weight`` is its derivative with respect to r2 / 2. c is the scale in pattern pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry.arrays import Array, namespace


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

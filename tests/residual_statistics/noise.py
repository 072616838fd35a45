"""Residual images with known correlation."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

SHAPE = (96, 132)


def white(rng: np.random.Generator, shape: tuple[int, int] = SHAPE) -> NDArray[np.float64]:
    return rng.standard_normal((*shape, 2))


def autoregressive(
    rng: np.random.Generator, rho: float, shape: tuple[int, int] = SHAPE
) -> NDArray[np.float64]:
    """Return unit-variance noise of covariance rho^|dx| rho^|dy|: AR(1) along both axes."""
    margin = 60  # the filter's start is forgotten
    r = rng.standard_normal((shape[0] + margin, shape[1] + margin, 2))
    for axis in (0, 1):
        r = lfilter([np.sqrt(1 - rho**2)], [1, -rho], r, axis=axis)
    return r[margin:, margin:]


def ar_design_effect(rho: float, length: int) -> float:
    """Return the design effect of an AR(1) block: (1 + 2 sum (1 - k/L) rho^k)^2 in two axes."""
    k = np.arange(1, length)
    return float(1 + 2 * ((1 - k / length) * rho**k).sum()) ** 2


def holes(rng: np.random.Generator, share: float = 0.4) -> NDArray[np.bool_]:
    """Return a mask of seen pixels: a disc, as an endoscope sees, less a share at random."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    disc = np.hypot(y - SHAPE[0] / 2, x - SHAPE[1] / 2) < 0.6 * SHAPE[0]
    return disc & (rng.random(SHAPE) >= share)

"""Spread and weights of values of which some are outliers."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAD_TO_STD = 1.4826
"""Standard deviation of normally distributed errors over their median size: 1 / Φ⁻¹(3/4)."""


def robust_std(errors: ArrayLike) -> float:
    """Return the standard deviation of errors about zero, any shape but empty, in their unit.

    Up to half of them may be outliers; it grows with their share.
    """
    return MAD_TO_STD * float(np.median(np.abs(errors)))


def geman_mcclure_weight(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rho'(r) / r of Geman and McClure's loss, any shape, for residuals over its scale."""
    return 1 / (1 + ratio**2) ** 2

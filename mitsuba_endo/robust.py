"""Spread of values of which some are outliers."""

import numpy as np
from numpy.typing import ArrayLike

MAD_TO_STD = 1.4826
"""Standard deviation of normally distributed errors over their median size: 1 / Φ⁻¹(3/4)."""


def robust_std(errors: ArrayLike) -> float:
    """Return the standard deviation of errors about zero, any shape but empty, in their unit.

    Up to half of them may be outliers; it grows with their share.
    """
    return MAD_TO_STD * float(np.median(np.abs(errors)))

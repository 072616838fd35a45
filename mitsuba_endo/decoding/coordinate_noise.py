"""How much coordinates scatter, measured on the map itself.

What is known of the images' noise explains only part of it: blur differs over the image, light is
scattered. Second differences of the map show all of it, on whatever smooth surface.
"""

import numpy as np
from numpy.typing import NDArray

FEW = 200
"""Second differences under which nothing is measured."""
LAGS = (1, 2, 4, 8, 16)
"""Pixels between the three of a difference."""
MOVED = 0.7
"""Share of a stripe that coordinates must move over a lag: errors within a stripe are alike."""
SHARE, LARGER = 80.0, 1.2816
"""Percentile of the differences that is measured, and that of a normal distribution: a median
would not see that a fifth of the pixels, those in the middle of stripes, scatter more."""
MEASURED = 1 << 22
"""Pixels measured: of larger maps every few rows."""


def with_measured_noise(
    q: NDArray[np.float32],
    spread: NDArray[np.float32],
    width: float,
    left_out: NDArray[np.uint8],
) -> NDArray[np.float32]:
    """Return standard deviations (H, W) to which what the map itself shows is added.

    To pixels with the same bits left out one more deviation is added, so that their second
    differences are as large as they should be.

    Args:
        q: (H, W) one coordinate, pattern pixels, NaN = missing.
        spread: (H, W) standard deviation by the images' noise.
        width: of the narrowest stripe, or the part of a fringe within which errors are alike.
        left_out: (H, W) fine bits that were left out.
    """
    result = spread.copy()
    finite = np.isfinite(q)
    for level in np.unique(left_out[finite]).tolist():
        chosen = finite & (left_out == level)
        stripe = width * 2**level
        measured = _scatter(np.where(chosen, q, np.nan), MOVED * stripe)
        if measured is None:
            # Anywhere in the stripe.
            further = stripe / 12**0.5
        else:
            by_noise = float(np.median(spread[chosen]))
            further = np.sqrt(max(measured**2 - by_noise**2, 0))
        result[chosen] = np.hypot(spread[chosen], np.float32(further))
    return result


def _scatter(q: NDArray[np.float32], least: float) -> float | None:
    """Return the standard deviation by second differences across the stripes."""
    q = q[:: max(1, q.size // MEASURED)] if q.size > MEASURED else q
    for lag in LAGS:
        for values in (q, q.T):
            ahead, here, behind = values[:, 2 * lag :], values[:, lag:-lag], values[:, : -2 * lag]
            second = ahead - 2 * here + behind
            finite = np.isfinite(second)
            across = finite & (np.abs(ahead - behind) >= 2 * least)
            if np.count_nonzero(across) >= max(FEW, 0.5 * np.count_nonzero(finite)):
                second = second[across]
                return float(np.percentile(np.abs(second), SHARE)) / (LARGER * 6**0.5)
    return None

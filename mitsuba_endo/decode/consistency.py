"""Rejection of pixels whose decoded coordinate fits none of its neighbours."""

import numpy as np
from numpy.typing import NDArray

SUPPORT = 3
"""Neighbours, of eight, that must agree: fewer happen by chance, or on a line of wrong code."""


def locally_consistent(q: NDArray[np.float32], slack: float) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that at least three of their neighbours support.

    A neighbour supports a pixel if they differ on both axes by less than ``slack`` and four times
    the median step between neighbours: a wrong bit throws a pixel far away, and pixels beside a
    depth edge still have neighbours on their own side.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        slack: error to be expected of a right pixel, pattern pixels.
    """
    padded = np.pad(q, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan)
    height, width = q.shape[:2]
    shifts = [(y, x) for y in range(3) for x in range(3) if (y, x) != (1, 1)]
    differences = (np.abs(padded[y : y + height, x : x + width] - q) for y, x in shifts)
    # NumPy reduces a last axis of length two far more slowly than this.
    steps = np.stack([np.maximum(a[..., 0], a[..., 1]) for a in differences])
    known = np.isfinite(steps)
    if not known.any():
        return np.zeros((height, width), bool)
    limit = slack + 4 * float(np.median(steps[known]))
    # A scattered map must not vouch for itself by its own large median step.
    limit = min(limit, 4 * slack + 16)
    return (known & (steps <= limit)).sum(0) >= SUPPORT

"""Rejection of pixels whose decoded coordinate fits none of its neighbours."""

import numpy as np
from numpy.typing import NDArray

SUPPORT = 3
"""Neighbours, of eight, that must agree: fewer happen by chance, or on a line of wrong code."""


MEDIAN_OF = 1 << 22
"""Pixels from whose differences the median step is taken: of larger maps every few rows."""
_HALF = ((0, 1), (1, -1), (1, 0), (1, 1))
"""Rows and columns to four neighbours: the other four are those of a pixel's neighbours."""


def locally_consistent(
    q: NDArray[np.float32], slack: float | NDArray[np.floating]
) -> NDArray[np.bool_]:
    """Return the pixels (H, W) that at least three of their neighbours support.

    A neighbour supports a pixel if they differ on both axes by less than ``slack`` and four times
    the median step between neighbours: a wrong bit throws a pixel far away, and pixels beside a
    depth edge still have neighbours on their own side.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        slack: error to be expected of a right pixel, pattern pixels; one or (H, W).
    """
    every = max(1, q[..., 0].size // MEDIAN_OF)
    steps = np.concatenate([_step(q, shift)[0][::every].ravel() for shift in _HALF])
    steps = steps[np.isfinite(steps)]
    if not steps.size:
        return np.zeros(q.shape[:2], bool)
    # A scattered map must not vouch for itself by its own large median step.
    limit = np.minimum(slack + 4 * float(np.median(steps)), 4 * slack + 16)
    limit = np.broadcast_to(np.float32(limit), q.shape[:2])
    support = np.zeros(q.shape[:2], np.uint8)
    for shift in _HALF:
        step, here, there = _step(q, shift)
        support[here] += step <= limit[here]
        support[there] += step <= limit[there]
    return support >= SUPPORT


def _step(
    q: NDArray[np.float32], shift: tuple[int, int]
) -> tuple[NDArray[np.float32], tuple[slice, slice], tuple[slice, slice]]:
    """Return the larger difference of pixels to a neighbour, and where both of them lie."""
    down, right = shift
    height, width = q.shape[:2]
    here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
    there = (slice(down, height), slice(max(0, right), width - max(0, -right)))
    # NumPy reduces a last axis of length two far more slowly than this.
    x, y = (np.abs(q[(*there, k)] - q[(*here, k)]) for k in (0, 1))
    return np.maximum(x, y), here, there

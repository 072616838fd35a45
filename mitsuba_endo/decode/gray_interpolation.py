"""Places within the stripes of a Gray code, from how far the bits have turned.

A pixel integrates over its own width and the lens's blur, so near the edge of a stripe the bit
that changes there is neither dark nor bright, and the nearer the edge the less so. How near
follows without any model of the blur: places within stripes are equally frequent, so the share of
the pixels whose bit has turned less is the distance from the edge, in half stripes.
"""

import numpy as np
from numpy.typing import NDArray

from .gray_code import stripe_index


def interpolate(
    q: NDArray[np.float32],
    signal: NDArray[np.floating],
    spread: NDArray[np.floating] | float,
    stripe: int,
) -> NDArray[np.float32]:
    """Return coordinates within their stripes for coordinates (H, W) of stripes' middles or edges.

    Where the bits at both edges have turned fully, within the noise, the middle stays.

    Args:
        q: pattern pixels, NaN = missing.
        signal: (bits, H, W) from -1 (dark) to 1 (bright), coarsest bit first.
        spread: standard deviation of the signals, a number or (H, W).
        stripe: width of the narrowest stripe, pattern pixels.
    """
    known = np.isfinite(q)
    if not known.any():
        return q
    turned = np.abs(signal[:, known])
    index = stripe_index(signal[:, known] > 0)
    before, after = (_at_edge(turned, edge) for edge in (index, index + 1))
    nearer = np.minimum(before, after)
    away = np.searchsorted(np.sort(nearer), nearer) / (2 * nearer.size)
    place = np.where(before < after, away, 1 - away)
    full = nearer > 1 - 3 * np.broadcast_to(spread, q.shape)[known]
    found = q.copy()
    found[known] = (index + np.where(full, 0.5, place)) * stripe - 0.5
    return found


def _at_edge(turned: NDArray[np.floating], edge: NDArray[np.int64]) -> NDArray[np.floating]:
    """Return how far (N,) the bit has turned that changes before stripe ``edge`` (N,)."""
    bits = len(turned)
    # Counting on changes the bit that is the lowest 1 of the new number.
    lowest = np.frexp((edge & -edge).astype(float))[1] - 1
    row = np.clip(bits - 1 - lowest, 0, bits - 1)
    # No bit changes at the pattern's ends.
    inner = (edge > 0) & (edge < 1 << bits)
    return np.where(inner, turned[row, np.arange(len(edge))], 1.0)

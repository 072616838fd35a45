"""Gray code along one axis: its images, and from their brightness back to pattern pixels.

Neighbouring stripes differ in one bit (F. Gray, US patent 2632058), so a pixel that straddles an
edge is in doubt about one bit only, and both readings of it are neighbours.
"""

import numpy as np
from numpy.typing import NDArray

CERTAIN = 0.25
"""A bit is certain if it lies this share of half the contrast away from the threshold."""


def bit_count(size: int, stripe: int = 1) -> int:
    """Return the bits that tell the stripes of ``size`` pattern pixels apart."""
    return max(1, (_stripes(size, stripe) - 1).bit_length())


def bit_images(size: int, stripe: int = 1) -> NDArray[np.float32]:
    """Return the profile of each bit along the axis, (bits, size) of 0 and 1, coarsest first."""
    index = np.arange(size) // stripe
    gray = index ^ (index >> 1)
    shift = np.arange(bit_count(size, stripe))[::-1, None]
    return ((gray >> shift) & 1).astype(np.float32)


def decode_bits(
    signal: NDArray[np.floating], doubt: NDArray[np.floating] | float, size: int, stripe: int = 1
) -> NDArray[np.float32]:
    """Return pattern pixels (H, W) from the signals of the bits.

    A pixel whose bits are all certain gets the middle of its stripe, one with one bit in doubt the
    edge between the two stripes it may belong to. Otherwise, and where the code lies outside the
    pattern, NaN.

    Args:
        signal: (bits, H, W) from -1 (dark) to 1 (bright), coarsest bit first.
        doubt: signals nearer to 0 than this, a number or (H, W), are uncertain.
        size: pattern pixels along the axis.
        stripe: width of the narrowest stripe, pattern pixels.
    """
    bits = signal > 0
    uncertain = np.abs(signal) < doubt
    count = uncertain.sum(0)
    low, high = stripe_index(bits & ~uncertain), stripe_index(bits | uncertain)
    neighbours = np.abs(low - high) == 1
    middle = (low + 0.5) * stripe - 0.5
    edge = np.maximum(low, high) * float(stripe) - 0.5
    q = np.where(count == 0, middle, np.where((count == 1) & neighbours, edge, np.nan))
    outside = np.maximum(low, high) >= _stripes(size, stripe)
    # The last stripe may be cut off by the pattern's end.
    return np.where(outside, np.nan, np.minimum(q, size - 0.5)).astype(np.float32)


def _stripes(size: int, stripe: int) -> int:
    return -(-size // stripe)


def stripe_index(bits: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Turn Gray bits, coarsest first, into numbers: each binary digit is the parity so far."""
    binary = np.logical_xor.accumulate(bits, axis=0)
    weight = 1 << np.arange(len(bits), dtype=np.int64)[::-1]
    return np.tensordot(weight, binary.astype(np.int64), axes=1)

"""Gray code and plain binary code along one axis: their images, and stripes from their signals.

Neighbouring stripes of Gray code differ in one bit (F. Gray, US patent 2632058), so a pixel that
straddles an edge is in doubt about one bit only, and both readings of it are neighbours.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

WHOLE = 1e-9
"""Stripes by which a boundary may miss a whole pixel by rounding."""
Code = Literal["gray", "binary"]


def stripe_count(size: int, stripe: float) -> int:
    """Return the stripes of ``stripe`` pixels that ``size`` pattern pixels hold."""
    return math.ceil(size / stripe - WHOLE)


def bit_count(size: int, stripe: float = 1) -> int:
    """Return the bits that tell the stripes of ``size`` pattern pixels apart."""
    return max(1, (stripe_count(size, stripe) - 1).bit_length())


def bit_images(size: int, stripe: float = 1, code: Code = "gray") -> NDArray[np.float32]:
    """Return the profile of each bit along the axis, (bits, size) of 0 and 1, coarsest first."""
    index = np.floor(np.arange(size) / stripe + WHOLE).astype(np.int64)
    word = index ^ (index >> 1) if code == "gray" else index
    shift = np.arange(bit_count(size, stripe))[::-1, None]
    return ((word >> shift) & 1).astype(np.float32)


def stripe_index(bits: NDArray[np.bool_], code: Code = "gray") -> NDArray[np.int32]:
    """Turn bits (bits, ...), coarsest first, into numbers of stripes (...).

    A binary digit is the parity of the Gray bits so far.
    """
    index = np.zeros(bits.shape[1:], np.int32)
    digit = np.zeros(bits.shape[1:], bool)
    for bit in bits:
        digit = digit ^ bit if code == "gray" else bit
        index <<= 1
        index |= digit
    return index


def read_stripes(
    signal: NDArray[np.floating],
    doubt: NDArray[np.floating] | float,
    code: Code = "gray",
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """Return the stripe (...) each pixel most probably lies in, and whether that is certain.

    Certain is a pixel whose bits are, and one at an edge: it is in doubt about the one bit that
    changes there, and both its readings are neighbours.

    Args:
        signal: (bits, ...) from -1 (dark) to 1 (bright), coarsest bit first.
        doubt: signals nearer to 0 than this are uncertain.
        code: of the bits.
    """
    bits, uncertain = signal > 0, np.abs(signal) < doubt
    low = stripe_index(bits & ~uncertain, code)
    high = stripe_index(bits | uncertain, code)
    one = uncertain.sum(0) == 1
    certain = ~uncertain.any(0) | (one & (np.abs(high - low) == 1))
    return stripe_index(bits, code), certain

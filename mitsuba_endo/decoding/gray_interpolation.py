"""Places within the stripes of a code, from how far the bits at their two edges have turned.

A pixel integrates over its own width and the lens's blur, so near the edge of a stripe the bit
that changes there is neither dark nor bright, and the nearer the edge the less so. How near
follows without any model of the blur: places within stripes are equally frequent, so the share of
the pixels that are turned less is the place within the stripe (histogram equalisation).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .gray_code import Code

ALIKE = 3
"""Bits from this one on, counted from the finest: blur is narrower than their stripes."""
FEW = 200
"""Pixels of one kind of stripe, under which their own shares say too little."""
TURNED = 3.0
"""Standard deviations of the noise within which a bit counts as wholly turned."""
ANYWHERE = np.float32(12**-0.5)
"""Standard deviation of a place that may be anywhere in a stripe, stripes."""
WILD = np.float32(100)
"""Most noise of a way that is told from more."""
TOGETHER = 1 << 20
"""Pixels ranked at once, to save memory."""
NEAR = 0.02
"""Share of the way between a stripe's edges over which the density of pixels is taken."""


@dataclass(frozen=True, eq=False)
class EdgeDistances:
    """How near pixels (...) lie to the two edges of their stripe, by signals alone."""

    ratio: NDArray[np.float32]
    """0 at the lower edge to 1 at the upper; in between, it only grows with the place."""
    noise: NDArray[np.floating]
    """Its standard deviation."""
    kind: NDArray[np.uint8]
    """Which bit changes at the edge that is not the finest bit's, none at the pattern's ends, and
    on which side that is."""
    inside: NDArray[np.bool_]
    """Both bits have turned wholly: nothing tells the place."""


def edge_distances(
    index: NDArray[np.int32],
    signal: NDArray[np.floating],
    noise: NDArray[np.floating],
    code: Code = "gray",
) -> EdgeDistances:
    """Compare the bits that change at both edges of each pixel's stripe.

    Args:
        index: (N,) stripe of each pixel.
        signal: (bits, N) over their amplitude, from -1 to 1, coarsest bit first.
        noise: (bits, N) standard deviation of the signals.
        code: of the bits.
    """
    lower, lower_noise, lower_bit = _at_edge(index, signal, noise)
    upper, upper_noise, upper_bit = _at_edge(index + 1, signal, noise)
    finest_below = lower_bit == 0
    if code == "binary":
        # The finest bit changes at both edges, so it does not tell them apart.
        lower, lower_noise = _unless(finest_below, lower, lower_noise)
        upper, upper_noise = _unless(~finest_below, upper, upper_noise)
    both = np.maximum(lower + upper, np.float32(1e-6))
    spread = np.minimum(np.hypot(upper * lower_noise, lower * upper_noise) / both**2, WILD)
    other = np.where(finest_below, upper_bit, lower_bit)
    turned = (lower > 1 - TURNED * lower_noise) & (upper > 1 - TURNED * upper_noise)
    ends = other == len(signal)
    kind = np.where(ends, ALIKE + 1, np.minimum(other, ALIKE)) + (ALIKE + 2) * finest_below
    return EdgeDistances((lower / both).astype(np.float32), spread, kind.astype(np.uint8), turned)


def _unless(
    finest: NDArray[np.bool_], turned: NDArray[np.floating], noise: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    one, none = np.float32(1), np.float32(0)
    return np.where(finest, one, turned), np.where(finest, none, noise)


def _at_edge(
    edge: NDArray[np.int32], signal: NDArray[np.floating], noise: NDArray[np.floating]
) -> tuple[NDArray[np.floating], NDArray[np.floating], NDArray[np.intp]]:
    """Return how far (N,) the bit has turned that changes before stripe ``edge``, noise, bit.

    Counting on changes the bit that is the lowest 1 of the new number. None changes at the
    pattern's ends: there the signal is 1.
    """
    bits = len(signal)
    lowest = np.frexp((edge & -edge).astype(np.float32))[1] - 1
    inner = (edge > 0) & (edge < 1 << bits)
    row, pixel = np.clip(bits - 1 - lowest, 0, bits - 1), np.arange(len(edge))
    turned = np.minimum(np.abs(signal[row, pixel]), np.float32(1))
    return (
        np.where(inner, turned, np.float32(1)),
        np.where(inner, noise[row, pixel], np.float32(0)),
        np.where(inner, lowest, bits).astype(np.intp),
    )


def place_within(
    distances: EdgeDistances,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the place (N,) of pixels within their stripes, 0 to 1, and its standard deviation."""
    position = np.full(distances.ratio.shape, np.float32(0.5))
    spread = np.full_like(position, ANYWHERE)
    for kind in np.unique(distances.kind):
        chosen = np.flatnonzero(distances.kind == kind)
        if len(chosen) < FEW:
            continue
        ratio, inside = distances.ratio[chosen], distances.inside[chosen]
        ranked = np.sort(ratio)
        for part in np.array_split(np.arange(len(chosen)), -(-len(chosen) // TOGETHER)):
            density = (
                (_rank(ranked, ratio[part] + NEAR) - _rank(ranked, ratio[part] - NEAR)) / 2 / NEAR
            )
            position[chosen[part]] = _rank(ranked, ratio[part])
            spread[chosen[part]] = density * distances.noise[chosen[part]]
        if inside.any():
            # Noise alone orders these: all lie somewhere in the stripe's middle part.
            position[chosen[inside]] = _rank(ranked, ratio[inside].mean())
            spread[chosen[inside]] = inside.mean() * ANYWHERE
    return position, spread


def _rank(ranked: NDArray[np.float32], value: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the share of sorted values that lie below; of equal ones, half do."""
    below, above = (np.searchsorted(ranked, value, side) for side in ("left", "right"))
    return ((below + above) / (2 * len(ranked))).astype(np.float32)

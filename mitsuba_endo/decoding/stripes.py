"""Coordinates from the bits of a stripe code, with the fine bits left out that cannot be read."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .axis_images import AxisImages
from .gray_code import read_stripes, stripe_count
from .gray_interpolation import ANYWHERE, EdgeDistances, edge_distances, place_within
from .stack_plan import Axis, StackPlan

READABLE = 0.2
"""Least amplitude of a bit, over the contrast, near a pixel. By hand: below, scattered light and
interreflections shift the threshold by as much."""
READABLE_OVER_NOISE = 6.0
"""The same over the signal's noise: the largest of a hundred pixels of noise is 3."""
CERTAIN = 0.2
"""A bit is certain if it lies this share of its amplitude away from the threshold. By hand."""
BIT_OVER_NOISE = 3.0
"""A bit nearer to its threshold than so many standard deviations of the noise is in doubt."""
MOST_LEFT_OUT = 4
"""Finest bits that may be left out. By hand: sixteen of the narrowest stripes."""
REACH = 5
"""Pixels around in which a bit's amplitude is sought. By hand: half a period of fine stripes."""
HALO = 2 * REACH
"""Rows beyond a strip that its pixels' amplitudes depend on."""
BEGIN = np.float32(1e-3)
"""Pixels by which a stripe's beginning may miss a whole one by rounding."""
BORDER = 2
"""Stripes at the pattern's ends whose places are not to be trusted."""
UNKNOWN_NOISE = np.float32(100)
"""Over the amplitude; more says no more."""
NONE = 255
"""Bits left out of a pixel that has no stripe."""


@dataclass(frozen=True, eq=False)
class StripeReading:
    """What the bits of an axis say of each pixel (H, W)."""

    index: NDArray[np.int16]
    """Stripe, of those 2^left_out times as wide as the narrowest."""
    left_out: NDArray[np.uint8]
    """Finest bits that cannot be read; NONE where the stripe is not known."""
    ratio: NDArray[np.float32]
    noise: NDArray[np.float16]
    kind: NDArray[np.uint8]
    inside: NDArray[np.bool_]
    """As of :class:`EdgeDistances`."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) pixels that have a stripe."""
        return self.left_out != NONE


def most_left_out(plan: StackPlan, axis: Axis) -> int:
    """Return how many bits may be left out: with phase images, stripes must tell fringes apart."""
    most = min(MOST_LEFT_OUT, plan.bits(axis) - 1)
    if plan.periods:
        most = min(most, int(np.log2(max(1, plan.periods[0] / 2 / plan.stripe))))
    return most


def read_bits(images: AxisImages, plan: StackPlan, axis: Axis, noise: float) -> StripeReading:
    """Read the bits of an axis, (H, W).

    Args:
        images: of the axis.
        plan: of the stack.
        axis: which.
        noise: standard deviation of the brightness.
    """
    signal, spread = images.signals(noise)
    amplitude = bit_amplitudes(signal)
    signal, relative = signal / amplitude, np.minimum(spread / amplitude, UNKNOWN_NOISE)
    readable = (amplitude >= READABLE) & (relative * READABLE_OVER_NOISE <= 1)
    wanted = np.zeros(spread.shape, np.uint8)
    for left_out in range(1, most_left_out(plan, axis) + 1):
        wanted[~readable[-left_out]] = left_out
    doubt = np.maximum(CERTAIN, BIT_OVER_NOISE * relative)
    shape = wanted.shape
    reading = StripeReading(
        np.zeros(shape, np.int16), np.full(shape, np.uint8(NONE)), np.zeros(shape, np.float32),
        np.zeros(shape, np.float16), np.zeros(shape, np.uint8), np.zeros(shape, np.bool_),
    )  # fmt: skip
    for level in range(most_left_out(plan, axis) + 1):
        # Where Gray bits are in doubt, the pixel lies in the middle of what the coarser ones tell,
        # so one more is left out; of binary ones, at an end of it.
        at = (wanted <= level) & ~reading.valid if plan.code == "gray" else wanted == level
        if not at.any():
            continue
        kept = slice(None, len(signal) - level)
        number, certain = read_stripes(signal[kept, at], doubt[kept, at], plan.code)
        certain &= number < stripe_count(plan.size[axis], plan.stripe * 2**level)
        reading.index[at], reading.left_out[at] = number, np.where(certain, level, NONE)
        edges = edge_distances(number, signal[kept, at], relative[kept, at], plan.code)
        for name in ("ratio", "noise", "kind", "inside"):
            getattr(reading, name)[at] = getattr(edges, name)
    return reading


def bit_amplitudes(signal: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest signal (bits, H, W) of either sign around each pixel, at most 1."""
    window = np.ones((2 * REACH + 1, 2 * REACH + 1), np.uint8)
    largest = (cv2.dilate(np.abs(image), window) for image in signal)
    smooth = [cv2.blur(image, (2 * REACH + 1, 2 * REACH + 1)) for image in largest]
    return np.clip(np.stack(smooth), 1e-3, 1).astype(np.float32, copy=False)


def coarse_coordinate(reading: StripeReading, plan: StackPlan, axis: Axis) -> NDArray[np.float32]:
    """Return the middles of the stripes, pattern pixels; NaN = not known.

    Of stripes that are fringes, the edges near which a pixel lies: there its fringe may be the
    neighbour's, which its phase tells.
    """
    position = thirds(reading.ratio) if plan.fringe_is_stripe else np.float32(0.5)
    return _coordinate(reading, position, plan, axis)


def thirds(ratio: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 0 near a stripe's lower edge, 1 near its upper one, a half between them.

    Near is a pixel whose bit at that edge has turned half as far as the one at the other edge.
    """
    return np.float32(0.5) * (ratio > 1 / 3) + np.float32(0.5) * (ratio > 2 / 3)


def fine_coordinate(
    reading: StripeReading, plan: StackPlan, axis: Axis
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return places within the stripes, pattern pixels, and their standard deviation; NaN.

    The whole image at once: how often a place is seen tells where it lies.
    """
    position = np.full(reading.left_out.shape, np.float32(0.5))
    spread = np.full(position.shape, np.float32(np.nan))
    for level in np.unique(reading.left_out[reading.valid]).tolist():
        at = reading.left_out == level
        edges = EdgeDistances(reading.ratio[at], reading.noise[at], reading.kind[at],
                              reading.inside[at])  # fmt: skip
        position[at], share = place_within(edges)
        last = stripe_count(plan.size[axis], plan.stripe * 2**level) - 1
        # Where the pattern ends, light from beyond it is missing in the blur.
        border = np.minimum(reading.index[at], last - reading.index[at]) < BORDER
        spread[at] = np.hypot(share, border * ANYWHERE) * (plan.stripe * 2**level)
    return _coordinate(reading, position, plan, axis), spread


def _coordinate(
    reading: StripeReading, position: NDArray[np.float32] | np.float32, plan: StackPlan, axis: Axis
) -> NDArray[np.float32]:
    left_out = np.where(reading.valid, reading.left_out, np.uint8(0)).astype(np.int32)
    # In place and in 32 bits: these arrays are as large as the image.
    wide = np.ldexp(np.float32(plan.stripe), left_out)
    q = reading.index.astype(np.float32)
    if plan.stripe % 1:
        # Stripes begin at whole pixels.
        begin, end = np.ceil(q * wide - BEGIN), np.ceil((q + 1) * wide - BEGIN)
        q = begin + position * (end - begin)
    else:
        q += position
        q *= wide
    q -= np.float32(0.5)
    # The last stripe may be cut off by the pattern's end.
    np.minimum(q, np.float32(plan.size[axis] - 0.5), out=q)
    q[~reading.valid] = np.nan
    return q

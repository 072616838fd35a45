"""Gray-code and phase-shift stacks: the images to project, and maps from images of them."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, NothingDecodedError
from .consistency import locally_consistent
from .gray_code import CERTAIN, bit_images, decode_bits
from .gray_interpolation import interpolate
from .phase_shift import phase_images, refine, unroll_coarsest, wrapped_coordinate
from .plan import AXES, Axis, StackPlan

MIN_CONTRAST = 0.03
"""Peak-to-peak contrast of a lit pixel, of full scale."""
CONTRAST_OVER_NOISE = 8.0
BIT_OVER_NOISE = 3.0
"""A bit nearer to its threshold than so many standard deviations of the noise is in doubt."""
NOISE_IMAGES = 8
"""Of the stack, evenly drawn, from which the noise is estimated."""
SWING = 0.98
"""Of projected phase images."""
ALL_WRONG = 0.3
"""If a smaller share of the lit pixels makes sense, the images mean something else."""
FEW = 100
"""Lit pixels from which on that is told."""


@dataclass(frozen=True, eq=False)
class Stack:
    """Images of one stack, in the order of its plan."""

    images: NDArray[np.float32]
    """(N, H, W) linear brightness from 0 to 1 = full scale."""
    saturated: NDArray[np.bool_]
    """(N, H, W) pixels of which a channel is at full scale."""
    levels: int
    """Grey levels of full scale: the images are quantised to them."""


@dataclass(frozen=True, eq=False)
class DecodedStack:
    """What a stack says."""

    q: NDArray[np.float32]
    """(H, W, 2) pattern pixels (x, y), integer = pixel centre, NaN = not lit or not certain."""
    lit: NDArray[np.bool_]
    """(H, W) pixels whose contrast is enough on both axes."""
    noise: float
    """Standard deviation of the brightness, of full scale."""

    @property
    def decoded(self) -> NDArray[np.bool_]:
        """(H, W) pixels that have a coordinate."""
        return np.isfinite(self.q[..., 0])


Levels = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Brightness of each pixel (H, W) under white and under black."""


def patterns(plan: StackPlan) -> list[NDArray[np.uint8]]:
    """Return the images (height, width) to project, in the order of ``plan.labels()``."""
    flat = [255, 0] if plan.reference else []
    images = [np.full((plan.height, plan.width), value, np.uint8) for value in flat]
    for axis in AXES:
        for profile in _profiles(plan, axis):
            line = np.rint(255 * profile).astype(np.uint8)
            across = line[None, :] if axis == "x" else line[:, None]
            images.append(np.broadcast_to(across, (plan.height, plan.width)).copy())
    return images


def _profiles(plan: StackPlan, axis: Axis) -> NDArray[np.float32]:
    """Return the brightness along the axis of each of its images, (images, size)."""
    size, parts = plan.size[axis], []
    if plan.stripe:
        bits = bit_images(size, plan.stripe)
        pairs = np.stack([bits, 1 - bits], 1).reshape(-1, size)
        parts.append(pairs if plan.inverse else bits)
    # A perfect copy of the projected images must not look saturated.
    waves = [phase_images(size, period, plan.steps) for period in plan.periods]
    return np.concatenate(parts + [0.5 + SWING * (wave - 0.5) for wave in waves])


def decode_stack(
    stack: Stack, plan: StackPlan, *, min_contrast: float = MIN_CONTRAST
) -> DecodedStack:
    """Decode a stack into projector coordinates.

    A pixel is lit if its contrast on both axes is at least ``min_contrast`` and eight times the
    noise, which is estimated from the images. Of the lit pixels those are left out whose code is
    in doubt or impossible, whose coarse and fine coordinates disagree, whose phase images are
    saturated, or which agree with too few of their neighbours.

    Raises:
        InputError: a wrong number of images, white and black are swapped, or lit pixels whose
            codes do not fit together, as with images in another order.
        NothingDecodedError: no pixel is lit, or none is certain.
    """
    expected = len(plan.labels())
    if len(stack.images) != expected:
        raise InputError(
            f"{len(stack.images)} images, but this pattern has {expected}",
            "stack", "check the pattern's options against what was projected",
        )  # fmt: skip
    noise = estimate_noise(stack)
    need = max(min_contrast, CONTRAST_OVER_NOISE * noise)
    white_black, rest = _split_reference(stack, plan, need)
    if white_black is None and plan.kind == "gray" and not plan.inverse:
        # Of both axes: along one, the first stripe is dark in every image.
        white_black = rest.images.max(0), rest.images.min(0)
    q, lit = [], np.ones(stack.images.shape[1:], bool)
    for axis in AXES:
        count = len(_profiles(plan, axis))
        part, rest = _slice(rest, 0, count), _slice(rest, count, None)
        coordinate, contrast = _decode_axis(part, plan, axis, white_black, noise)
        lit &= contrast >= need
        q.append(coordinate)
    found = np.stack(q, -1)
    found[~(lit & np.isfinite(found).all(-1))] = np.nan
    return _checked(found, lit, np.asarray(stack.saturated.any(0)), noise, plan, need)


def _slice(stack: Stack, start: int, stop: int | None) -> Stack:
    return Stack(stack.images[start:stop], stack.saturated[start:stop], stack.levels)


def _split_reference(stack: Stack, plan: StackPlan, need: float) -> tuple[Levels | None, Stack]:
    if not plan.reference:
        return None, stack
    white, black = stack.images[:2]
    if (black - white >= need).sum() > (white - black >= need).sum():
        raise InputError(
            "the white image is darker than the black one", "stack",
            "give the white one first, then the black one, or --no-reference",
        )  # fmt: skip
    return (white, black), _slice(stack, 2, None)


def estimate_noise(stack: Stack) -> float:
    """Return the standard deviation of the brightness, of full scale.

    From the product of second differences along both axes, which removes whatever depends on one
    axis alone and smooth shading (J. Immerkaer, "Fast noise variance estimation", 1996); its median
    leaves edges out. Never less than the rounding to whole grey levels.
    """
    kernel = np.outer([1, -2, 1], [1, -2, 1]).astype(np.float32)
    chosen = np.unique(np.linspace(0, len(stack.images) - 1, NOISE_IMAGES).astype(int))
    scale = 1.4826 / np.linalg.norm(kernel)
    found = [
        float(np.median(np.abs(cv2.filter2D(stack.images[i], -1, kernel)))) * scale for i in chosen
    ]
    return max(float(np.median(found)), 1 / (stack.levels * np.sqrt(12)))


def _decode_axis(
    stack: Stack,
    plan: StackPlan,
    axis: Axis,
    white_black: Levels | None,
    noise: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return q along the axis and the peak-to-peak contrast, both (H, W)."""
    size = plan.size[axis]
    grays = plan.bits(axis) * (2 if plan.inverse else 1)
    bits, waves = _slice(stack, 0, grays), _slice(stack, grays, None)
    if plan.kind == "gray":
        return _decode_gray(bits.images, plan, size, white_black, noise)
    q, contrast = None, np.full(stack.images.shape[1:], np.inf, np.float32)
    if plan.kind == "gray+phase":
        levels = white_black or _wave_levels(waves.images)
        q, contrast = _decode_gray(bits.images, plan, size, levels, noise)
    for k, period in enumerate(plan.periods):
        steps = _slice(waves, k * plan.steps, (k + 1) * plan.steps)
        fine, swing = wrapped_coordinate(steps.images, period)
        contrast = np.minimum(contrast, swing)
        fine[steps.saturated.any(0)] = np.nan
        q = unroll_coarsest(fine, period, size) if q is None else refine(q, fine, period)
    assert q is not None, "a plan has Gray code or a period"
    return np.where((q >= -0.5) & (q <= size - 0.5), q, np.nan), contrast


def _wave_levels(images: NDArray[np.float32]) -> Levels:
    """Return white and black from the mean and swing of a pixel's phase images."""
    mean, (_, swing) = images.mean(0), wrapped_coordinate(images, 1.0)
    return mean + swing / 2, mean - swing / 2


def _pair_levels(pairs: NDArray[np.float32]) -> Levels:
    """Return white and black from bits and their inverses, of which blur may wash out the finest.

    Args:
        pairs: (bits, 2, H, W).
    """
    return np.median(pairs.max(1), 0), np.median(pairs.min(1), 0)


def _decode_gray(
    images: NDArray[np.float32],
    plan: StackPlan,
    size: int,
    levels: Levels | None,
    noise: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    pairs = images.reshape(-1, 2, *images.shape[1:]) if plan.inverse else None
    if levels is None:
        assert pairs is not None, "bits without inverse come with levels"
        levels = _pair_levels(pairs)
    white, black = levels
    contrast = white - black
    safe = np.maximum(contrast, np.float32(1e-6))
    if pairs is not None:
        signal, spread = (pairs[:, 0] - pairs[:, 1]) / safe, np.sqrt(2) * noise
    else:
        # The threshold is the mean of two measured levels, so its own noise counts too.
        signal, spread = (2 * images - white - black) / safe, np.sqrt(6) * noise
    doubt = np.maximum(CERTAIN, BIT_OVER_NOISE * spread / safe)
    q = decode_bits(signal, doubt, size, plan.stripe)
    # With phase images, the fringe is all that is asked of the code.
    return q if plan.periods else interpolate(q, signal, spread / safe, plan.stripe), contrast


def _checked(
    q: NDArray[np.float32],
    lit: NDArray[np.bool_],
    saturated: NDArray[np.bool_],
    noise: float,
    plan: StackPlan,
    need: float,
) -> DecodedStack:
    """Drop pixels that agree with too few of their neighbours, and say why nothing is left."""
    if not lit.any():
        raise NothingDecodedError(
            f"no pixel changes by {100 * need:.1f} % of full scale from image to image", "stack",
            "check exposure and ambient light, or lower the required contrast",
        )  # fmt: skip
    agree = locally_consistent(q, slack=max(2.0, 1.5 * plan.stripe if plan.kind == "gray" else 0.0))
    q = np.where(agree[..., None], q, np.nan).astype(np.float32)
    usable = int((lit & ~saturated).sum())
    if usable >= FEW and agree.sum() < ALL_WRONG * usable:
        raise InputError(
            f"{usable} pixels are well lit, but only {agree.sum()} of them make sense", "stack",
            "check the order of the images, the pattern's size and its options, and the focus",
        )  # fmt: skip
    if not agree.any():
        raise NothingDecodedError(
            "no lit pixel has a certain code", "stack", "check focus, exposure and stripe widths"
        )
    return DecodedStack(q, lit, noise)

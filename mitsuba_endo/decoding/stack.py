"""Gray-code and phase-shift stacks: maps from images of them, strip by strip."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, NothingDecodedError
from .axis_images import axis_images, labels_needed
from .consistency import locally_consistent
from .coordinate_noise import with_measured_noise
from .fringes import fringe_coordinate, within
from .row_chunks import inner_rows, row_chunks, with_rows
from .stack_images import Stack, StackSource, estimate_noise
from .stack_plan import AXES, Axis, StackPlan
from .stripes import HALO, StripeReading, coarse_coordinate, fine_coordinate, read_bits

MIN_CONTRAST = 0.03
"""Peak-to-peak contrast of a lit pixel, of full scale."""
CONTRAST_OVER_NOISE = 8.0
"""Least contrast of a lit pixel, standard deviations of the noise."""
ALL_WRONG = 0.3
"""If a smaller share of the lit pixels makes sense, the images mean something else."""
FEW = 100
"""Lit pixels from which on that is told."""
LEAST_SLACK = 2.0
"""Pattern pixels by which neighbours may differ in any case."""
BEST = 1.0
"""Percentile of the variances whose weight is 1."""
WAYS = 4
"""Parts of a fringe within which errors are alike: harmonics of a camera's curve are finer."""


@dataclass(frozen=True, eq=False)
class DecodedStack:
    """What a stack says."""

    q: NDArray[np.float32]
    """(H, W, 2) pattern pixels (x, y), integer = pixel centre, NaN = not lit or not certain."""
    variance: NDArray[np.float32]
    """(H, W) of a coordinate, mean of both axes, pattern pixels squared; NaN = not known."""
    lit: NDArray[np.bool_]
    """(H, W) pixels whose contrast is enough on both axes."""
    left_out: NDArray[np.uint8]
    """(H, W) fine bits that could not be read, the more of both axes."""
    noise: float
    """Standard deviation of the brightness, of full scale."""

    @property
    def decoded(self) -> NDArray[np.bool_]:
        """(H, W) pixels that have a coordinate."""
        return np.isfinite(self.q[..., 0])

    @property
    def weight(self) -> NDArray[np.float32]:
        """(H, W) 1 / variance relative to the best, at most 1; 0 = not known."""
        variances = self.variance[self.decoded]
        best = float(np.percentile(variances, BEST)) if variances.size else 1.0
        weight = np.minimum(best / np.where(self.decoded, self.variance, np.inf), 1)
        return weight.astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Light:
    """What the light of an axis's images says of pixels (H, W)."""

    lit: NDArray[np.bool_]
    saturated: NDArray[np.bool_]
    """An image is."""
    left_out: NDArray[np.uint8]
    """Fine bits that cannot be read."""


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """One coordinate (H, W), pattern pixels."""

    q: NDArray[np.float32]
    spread: NDArray[np.float32]
    """Standard deviation by the images' noise."""


_Axis = tuple[_Light, _Coordinates]


def decode_stack(
    stack: StackSource,
    plan: StackPlan,
    *,
    min_contrast: float = MIN_CONTRAST,
    order: Sequence[int] | None = None,
    advance: Callable[[float], None] = lambda share: None,
) -> DecodedStack:
    """Decode a stack into projector coordinates.

    A pixel is lit if its contrast on both axes is at least ``min_contrast`` and eight times the
    noise, which is estimated from the images. Fine bits that cannot be read at a lit pixel are
    left out, and its variance grows by it. Of the lit pixels those are left out whose code is
    otherwise in doubt or impossible, whose coarse and fine coordinates disagree, whose phase images
    are saturated, or which agree with too few of their neighbours.

    Args:
        stack: the images.
        plan: what they show.
        min_contrast: of full scale.
        order: which image shows each of ``plan.labels()``; default as they come.
        advance: called with the share that is done.

    Raises:
        InputError: a wrong number of images, white and black are swapped, or lit pixels whose
            codes do not fit together, as with images in another order.
        NothingDecodedError: no pixel is lit, or none is certain.
    """
    labels = plan.labels()
    if len(stack) != len(labels):
        raise InputError(
            f"{len(stack)} images, but this pattern has {len(labels)}",
            "stack", "check the pattern's options against what was projected",
        )  # fmt: skip
    image_index = dict(zip(labels, range(len(stack)) if order is None else order, strict=True))
    noise = estimate_noise(stack)
    need = max(min_contrast, CONTRAST_OVER_NOISE * noise)
    _check_reference(stack, plan, image_index, need)
    axes = [
        _decode_axis(stack, plan, axis, image_index, noise, need, partial(_part, advance, k))
        for k, axis in enumerate(AXES)
    ]
    return _joined(axes, plan, noise, need)


def _part(advance: Callable[[float], None], axis: int, share: float) -> None:
    advance((axis + share) / len(AXES))


def _check_reference(
    stack: StackSource, plan: StackPlan, image_index: dict[str, int], need: float
) -> None:
    if not plan.reference:
        return
    brighter = darker = 0
    for start, stop in row_chunks(stack.shape, 2):
        white, black = stack.rows([image_index["white"], image_index["black"]], start, stop).images
        brighter += int((white - black >= need).sum())
        darker += int((black - white >= need).sum())
    if darker > brighter:
        raise InputError(
            "the white image is darker than the black one", "stack",
            "give the white one first, then the black one, or --no-reference",
        )  # fmt: skip


def _decode_axis(
    stack: StackSource,
    plan: StackPlan,
    axis: Axis,
    image_index: Mapping[str, int],
    noise: float,
    need: float,
    advance: Callable[[float], None],
) -> _Axis:
    """Decode an axis strip by strip."""
    height = stack.shape[0]
    labels = labels_needed(plan, axis)
    light: _Light | None = None
    whole: Any = None
    for start, stop in row_chunks(stack.shape, len(labels), HALO):
        low, high = max(0, start - HALO), min(height, stop + HALO)
        strip = stack.rows([image_index[label] for label in labels], low, high)
        inner = slice(start - low, stop - low)
        decoded = _decode_strip(strip, labels, plan, axis, noise, need)
        light, whole = (
            with_rows(so_far, inner_rows(part, inner), start, height)
            for so_far, part in zip((light, whole), decoded, strict=True)
        )
        advance(stop / height)
    assert light is not None, "images have rows"
    if isinstance(whole, StripeReading):
        # How often a place is seen is a matter of the whole image.
        return light, _Coordinates(*fine_coordinate(whole, plan, axis))
    return light, whole


def _decode_strip(
    strip: Stack, labels: Sequence[str], plan: StackPlan, axis: Axis, noise: float, need: float
) -> tuple[_Light, StripeReading | _Coordinates]:
    """Return what rows with their halo say: stripes of a code alone, or else coordinates."""
    images = axis_images(dict(zip(labels, strip.images, strict=True)), plan, axis)
    reading = read_bits(images, plan, axis, noise) if plan.stripe else None
    some = np.asarray(strip.saturated.any(0))
    if reading is not None and not plan.periods:
        return _Light(images.contrast >= need, some, reading.left_out), reading
    coarse = None if reading is None else coarse_coordinate(reading, plan, axis)
    saturated = dict(zip(labels, strip.saturated, strict=True))
    full = [
        np.any([saturated[label] for label in steps], axis=0) for steps in plan.phase_labels(axis)
    ]
    q, spread, contrast = fringe_coordinate(images, full, plan, axis, coarse, noise)
    # The phases know better than the code, whatever was left out of it.
    light = _Light(contrast >= need, some, np.zeros(q.shape, np.uint8))
    return light, _Coordinates(within(q, plan.size[axis]), spread)


def nothing_lit(need: float) -> NothingDecodedError:
    """Return the error of images without a pattern, whose lit pixels need so much contrast."""
    return NothingDecodedError(
        f"no pixel changes by {100 * need:.1f} % of full scale from image to image", "stack",
        "check exposure and ambient light, or lower the required contrast",
    )  # fmt: skip


def _joined(axes: Sequence[_Axis], plan: StackPlan, noise: float, need: float) -> DecodedStack:
    """Drop pixels that agree with too few of their neighbours, and say why nothing is left."""
    (x_light, x), (y_light, y) = axes
    lit = x_light.lit & y_light.lit
    if not lit.any():
        raise nothing_lit(need)
    q = np.stack([x.q, y.q], -1)
    q[~(lit & np.isfinite(q).all(-1))] = np.nan
    left_out = np.maximum(x_light.left_out, y_light.left_out)
    left_out[~np.isfinite(q[..., 0])] = 0
    wide = np.float32(1.5 * plan.stripe) * (1 << left_out.astype(np.int16))
    slack = np.maximum(np.float32(LEAST_SLACK), wide) if plan.kind == "gray" else LEAST_SLACK
    q[~locally_consistent(q, slack)] = np.nan
    decoded = np.isfinite(q[..., 0])
    usable = int((lit & ~(x_light.saturated | y_light.saturated)).sum())
    if usable >= FEW and decoded.sum() < ALL_WRONG * usable:
        raise InputError(
            f"{usable} pixels are well lit, but only {decoded.sum()} of them make sense", "stack",
            "check the order of the images, the pattern's size and its options, and the focus",
        )  # fmt: skip
    if not decoded.any():
        raise NothingDecodedError(
            "no lit pixel has a certain code", "stack", "check focus, exposure and stripe widths"
        )
    variance = _variance(x_light, x, plan)
    variance += _variance(y_light, y, plan)
    variance /= 2
    variance[~decoded] = np.nan
    return DecodedStack(q, variance, lit, left_out, noise)


def _variance(light: _Light, coordinates: _Coordinates, plan: StackPlan) -> NDArray[np.float32]:
    """Return the variance of an axis's coordinates (H, W)."""
    width = plan.stripe if plan.kind == "gray" else plan.periods[-1] / WAYS
    q = np.where(light.lit, coordinates.q, np.float32(np.nan))
    spread = with_measured_noise(q, coordinates.spread, width, light.left_out)
    return (spread**2).astype(np.float32, copy=False)

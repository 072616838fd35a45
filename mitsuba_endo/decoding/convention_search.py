"""Finding the convention of a stack from its images: decode under each, and see what makes sense.

The right hypothesis gives a map that is smooth and not mirrored. Others give jumps, coordinates
beyond the pattern, or, where an axis is swapped or turned, a mirrored map: of a surface seen by
camera and projector from the same side, dq/dp has a positive determinant.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .axis_images import AxisImages, labels_needed
from .conventions import OPTION, StackConvention, StackOrder, Stated, orders
from .fringes import fringe_coordinate, within
from .gray_code import Code, read_stripes, stripe_count
from .gray_interpolation import edge_distances
from .phase_search import periods_agree, phase_conventions
from .phase_shift import PhaseConvention
from .possible_plans import ONE_DIRECTION, PossiblePlans
from .sample_map import AxisMap, SampleMap, joined
from .stack import nothing_lit
from .stack_images import StackSource
from .stack_plan import AXES, Axis, StackPlan
from .stack_samples import StackSamples, take_samples
from .stripes import BIT_OVER_NOISE, CERTAIN, most_left_out, thirds

WHOLLY = 0.9
"""Of the lit pixels that must be brightest under white, and darkest under black."""
ALMOST = 0.1
"""Of a pixel's contrast, by which another image may be brighter than the white one."""
HARDLY = 0.005
"""Of the contrast of the images' means, by which white and black may be second to another one."""
LEAST_SHARE = 0.6
"""Of the lit samples that must be smooth and not mirrored. Chance gives a third at most."""
ALIKE = 0.8
"""Of the best hypothesis' share, from which another one that gives another map is as good."""
SAME = 0.98
"""Of the best hypothesis' share, from which another one with the same map is as likely."""
OTHER_MAP = 0.5
"""Of the width that coordinates are rounded to, by which half of another map's samples differ."""
FINE = 0.15
"""Pattern pixels to which a phase's coordinate is rounded at least, for lack of a better camera."""
OVER_NOISE = 4.0
"""The same over the standard deviation by the images' noise."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One reading of a stack."""

    plan: StackPlan
    convention: StackConvention
    positions: tuple[int, ...]
    """Which image shows each of the plan's labels."""
    map: SampleMap
    """Of samples."""

    def words(self) -> list[str]:
        """Return the words that state the convention."""
        return self.convention.words(self.plan)

    def describe(self) -> str:
        """Return the options that state this reading."""
        plan = self.plan
        options = [
            f"--pattern {plan.kind}",
            f"--stripe {plan.stripe:g}" if plan.stripe else "",
            f"--steps {plan.steps}" if plan.steps else "",
            f"{OPTION} {','.join(self.words())}",
        ]
        return " ".join(option for option in options if option)


def find_convention(
    stack: StackSource,
    possible: PossiblePlans,
    stated: Stated,
    reference: str | None,
    noise: float,
    need: float,
    advance: Callable[[float], None] = lambda share: None,
) -> Hypothesis:
    """Return the reading of a stack that makes sense.

    Args:
        stack: the images.
        possible: plans that have as many images.
        stated: what is known of the convention.
        reference: where the white and the black image are, "first", "last", "none"; None: found.
        noise: standard deviation of the brightness.
        need: least contrast of a lit pixel.
        advance: called with the share that is done.

    Raises:
        InputError: no reading makes sense, or two do.
        NothingDecodedError: no pixel is lit.
    """
    samples = take_samples(stack, noise, need)
    if not samples.lit.any():
        raise nothing_lit(need)
    tried = [
        (plan, pair, order)
        for plan in possible.plans
        for pair in _references(samples, plan, reference)
        for order in orders(plan, stated)
    ]
    readings: list[Hypothesis] = []
    for k, (plan, pair, order) in enumerate(tried):
        readings += _readings(samples, plan, pair, order, stated)
        advance((k + 1) / len(tried))
    return _best(readings, len(tried), possible.one_direction)


def _references(
    samples: StackSamples, plan: StackPlan, reference: str | None
) -> list[tuple[int, int] | None]:
    """Return where the white and the black image may be; None: there are none."""
    if not plan.reference:
        return [None] if reference in (None, "none") else []
    if reference == "none" or not samples.lit.any():
        return []
    images = samples.images[:, samples.lit]
    high, low = images.max(0), images.min(0)
    slack = ALMOST * (high - low)
    white = np.flatnonzero((images >= high - slack).mean(1) >= WHOLLY).tolist()
    black = np.flatnonzero((images <= low + slack).mean(1) >= WHOLLY).tolist()
    last = len(images) - 1
    ends = {"first": {0, 1}, "last": {last - 1, last}}
    pairs: list[tuple[int, int]] = []
    for w in _extreme(white, images, 1):
        pairs += [(w, b) for b in _extreme(black, images, -1)]
    if reference is not None:
        pairs = [pair for pair in pairs if set(pair) == ends[reference]]
    # The commonest places first.
    pairs.sort(key=lambda pair: set(pair) not in ends.values())
    return list(pairs)


def _extreme(among: list[int], images: NDArray[np.float32], sign: int) -> list[int]:
    """Return the brightest or darkest of images (N, n), and those that are hardly less so."""
    mean = sign * images.mean(1)
    contrast = float(np.ptp(mean))
    best = max((float(mean[k]) for k in among), default=0.0)
    return [k for k in among if mean[k] >= best - HARDLY * contrast]


def _readings(
    samples: StackSamples,
    plan: StackPlan,
    reference: tuple[int, int] | None,
    order: StackOrder,
    stated: Stated,
) -> Iterator[Hypothesis]:
    """Yield the readings of one order that make some sense."""
    free = [k for k in range(len(samples.images)) if k not in (reference or ())]
    image_index = dict(zip(order.labels(plan), free, strict=True))
    if reference is not None:
        image_index["white"], image_index["black"] = reference
    if not samples.balanced(plan, image_index):
        return
    if plan.stripe and not samples.fine_bits_vary(plan, image_index):
        return
    positions = tuple(image_index[label] for label in plan.labels())
    codes: tuple[Code, ...] = ("gray", "binary") if plan.stripe else ("gray",)
    for code in codes:
        if not stated.allows("code", code):
            continue
        coded = replace(plan, code=code)
        for phase, map_ in _maps(samples, coded, image_index, stated):
            convention = StackConvention(order, code, phase.sign, phase.offset)
            yield Hypothesis(replace(coded, phase=phase), convention, positions, map_)


def _maps(
    samples: StackSamples, plan: StackPlan, image_index: dict[str, int], stated: Stated
) -> Iterator[tuple[PhaseConvention, SampleMap]]:
    """Yield the maps under each convention of the phases that fits at all."""
    coarse: list[AxisMap] = []
    for axis in AXES if plan.stripe else ():
        coarse.append(_stripes(samples, plan, axis, image_index))
        if coarse[-1].share < LEAST_SHARE:
            return
    if plan.kind == "gray":
        yield plan.phase, joined(coarse, samples.lit)
        return
    coordinates = [np.where(np.isfinite(axis.q), axis.q, np.float32(np.nan)) for axis in coarse]
    if coarse and joined(coarse, samples.lit).share < LEAST_SHARE:
        return
    for phase in phase_conventions(samples, plan, image_index, coordinates, stated):
        axes: list[AxisMap] = []
        for axis, coarse_q in zip(AXES, coordinates or (None, None), strict=True):
            axes.append(_fringes(samples, replace(plan, phase=phase), axis, image_index, coarse_q))
            if axes[-1].share < LEAST_SHARE:
                break
        else:
            yield phase, joined(axes, samples.lit)


def _fringes(
    samples: StackSamples,
    plan: StackPlan,
    axis: Axis,
    image_index: dict[str, int],
    coarse: NDArray[np.float32] | None,
) -> AxisMap:
    images = samples.axis(plan, axis, image_index)
    if not periods_agree(images, plan, axis, coarse, samples.lit):
        return AxisMap.of(np.full(samples.lit.shape, np.float32(np.nan)), images.white, samples.lit)
    none = [np.zeros(samples.lit.shape, bool) for _ in plan.periods]
    q, spread, _ = fringe_coordinate(images, none, plan, axis, coarse, samples.noise)
    width = np.maximum(np.float32(FINE), np.float32(OVER_NOISE) * spread)
    return AxisMap.of(within(q, plan.size[axis], beyond=np.inf), width, samples.lit)


def _stripes(
    samples: StackSamples, plan: StackPlan, axis: Axis, image_index: dict[str, int]
) -> AxisMap:
    """Return the middles of an axis's stripes."""
    labels = labels_needed(plan, axis)
    key = (axis, plan.kind, plan.stripe, plan.inverse, plan.steps, plan.code,
           *(image_index[label] for label in labels))  # fmt: skip
    if key not in samples.cache:
        images = samples.axis(plan, axis, image_index)
        q, width = _middles(images, plan, axis, samples.noise)
        samples.cache[key] = AxisMap.of(q, width, samples.lit)
    return samples.cache[key]


def _middles(
    images: AxisImages, plan: StackPlan, axis: Axis, noise: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    signal, spread = images.signals(noise)
    doubt = np.maximum(CERTAIN, BIT_OVER_NOISE * spread)
    q = np.full(spread.shape, np.float32(np.nan))
    width = np.full(spread.shape, np.float32(plan.stripe))
    left = np.ones(spread.shape, bool)
    for level in range(most_left_out(plan, axis) + 1):
        stripe = plan.stripe * 2**level
        index, certain = read_stripes(signal[: len(signal) - level], doubt, plan.code)
        certain &= left
        left &= ~certain
        inside = certain & (index < stripe_count(plan.size[axis], stripe))
        # Those beyond the pattern stay, to be counted.
        position = 0.5
        if plan.fringe_is_stripe:
            noises = np.broadcast_to(spread, signal.shape)[:, certain]
            distances = edge_distances(index[certain], signal[:, certain], noises, plan.code)
            position = thirds(distances.ratio)
        q[certain], width[certain] = (index[certain] + position) * stripe - 0.5, stripe
        q[certain & ~inside] = np.inf
    return q, width


def _best(readings: Sequence[Hypothesis], tried: int, one_direction: bool) -> Hypothesis:
    ranked = sorted(readings, key=lambda one: -one.map.share)
    if not ranked or ranked[0].map.share < LEAST_SHARE:
        raise _nothing_fits(ranked, tried, one_direction)
    best = ranked[0]
    for other in ranked[1:]:
        if other.map.share >= ALIKE * best.map.share and not _same_map(best, other):
            raise InputError(
                f"the images fit two readings alike: {best.describe()}, and {other.describe()}",
                "stack", "state the right one",
            )  # fmt: skip
    # Of those that are the same, the commonest.
    return next(one for one in readings if one.map.share >= SAME * best.map.share)


def _nothing_fits(ranked: Sequence[Hypothesis], tried: int, one_direction: bool) -> InputError:
    turned = max(ranked, key=lambda one: one.map.mirrored, default=None)
    if turned and turned.map.mirrored >= LEAST_SHARE:
        return InputError(
            f"what the images show is mirrored, if they are {turned.describe()}", "stack",
            "turn off mirroring in the camera or the projector, or state what they are",
        )  # fmt: skip
    share = f"; the best makes sense of {100 * ranked[0].map.share:.0f} %" if ranked else ""
    return InputError(
        f"none of {tried} orders and codes fits the images{share}", "stack",
        (f"{ONE_DIRECTION}; else " if one_direction else "")
        + f"check the pattern's size and its options, and the focus, or state {OPTION}",
    )  # fmt: skip


def _same_map(one: Hypothesis, other: Hypothesis) -> bool:
    apart = np.abs(np.where(np.isfinite(one.map.q), one.map.q, np.nan) - other.map.q).max(-1)
    finite = np.isfinite(apart)
    width = np.minimum(one.map.width, other.map.width)
    return bool(finite.any()) and float(np.median((apart / width)[finite])) < OTHER_MAP

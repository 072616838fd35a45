"""Which conventions of the phases fit the samples of a stack."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from .axis_images import AxisImages
from .conventions import Stated
from .heterodyne import bias, unwrap
from .phase_shift import MAX_DEVIATION, PhaseConvention, refine, unroll_coarsest, wrapped_coordinate
from .stack_plan import AXES, Axis, StackPlan
from .stack_samples import StackSamples

OFF_PHASE = 0.03
"""Turns by which the mean phase may differ from a convention's."""
OFF_COARSER = 0.05
"""Turns by which the mean phase of a period may differ from what the coarser one says."""
LEAST_FITTING = 0.3
"""Share of the samples whose periods fit together, under which an offset is not considered."""
NEARLY = 2.0
"""Of the least mean misfit, up to which another offset is as likely."""
EDGE = 0.4
"""Stripes from its middle, from which a coordinate is an edge's."""
CONCENTRATED = 0.6
"""Length of the mean of coarse minus fine phase on the circle: one, if all agree."""


def phase_conventions(
    samples: StackSamples,
    plan: StackPlan,
    image_index: dict[str, int],
    coarse: Sequence[NDArray[np.float32]],
    stated: Stated,
) -> Iterator[PhaseConvention]:
    """Yield what the phases may show: all conventions, or with a code those that fit it."""
    for sign in (1, -1):
        if not stated.allows("sign", sign):
            continue
        offsets = [o for o in usual_offsets(plan.steps, sign) if stated.allows("offset", o)]
        wanted = [value for name, value in stated.parts if name == "offset"]
        offsets += [float(str(value)) for value in wanted if value not in offsets]
        if coarse:
            measured = [
                _offset(samples, plan, axis, image_index, coarse[k], sign)
                for k, axis in enumerate(AXES)
            ]
            offsets = [o for o in offsets if all(_near(o, m) for m in measured)][:1]
        elif plan.heterodyne:
            offsets = _unbiased(samples, plan, image_index, sign, offsets)
        yield from (PhaseConvention(sign, offset) for offset in offsets)


def usual_offsets(steps: int, sign: int) -> list[float]:
    """Return the offsets, turns, of cosine and sine whose first shift is none, one, or centred."""
    firsts = (0.0, 1.0, -(steps - 1) / 2)
    offsets = [(base + sign * first / steps) % 1 for first in firsts
               for base in (0.0, 0.75, 0.5, 0.25)]  # fmt: skip
    return list(dict.fromkeys(round(offset, 9) % 1 for offset in offsets))


def _near(offset: float, measured: float | None) -> bool:
    if measured is None:
        return False
    return abs((offset - measured + 0.5) % 1 - 0.5) < OFF_PHASE


def _unbiased(
    samples: StackSamples,
    plan: StackPlan,
    image_index: dict[str, int],
    sign: int,
    offsets: list[float],
) -> list[float]:
    """Return the offset under which the periods agree in the mean, and those nearly as good.

    Periods of nearly one length take a wrong offset for a place a little aside.
    """
    misfits = {}
    for offset in offsets:
        phase = PhaseConvention(sign, offset)
        misfits[offset] = max(_misfit(samples, plan, axis, image_index, phase) for axis in AXES)
    best = min(misfits.values(), default=np.inf)
    return [o for o in offsets if misfits[o] <= NEARLY * best < np.inf]


def _misfit(
    samples: StackSamples,
    plan: StackPlan,
    axis: Axis,
    image_index: dict[str, int],
    phase: PhaseConvention,
) -> float:
    waves = samples.axis(plan, axis, image_index).waves
    wrapped = [
        wrapped_coordinate(images, period, phase)[0][samples.lit]
        for images, period in zip(waves, plan.periods, strict=True)
    ]
    q = unwrap(wrapped, plan.periods, plan.size[axis])
    return bias(q, wrapped, plan.periods) if np.isfinite(q).mean() >= LEAST_FITTING else np.inf


def _offset(
    samples: StackSamples,
    plan: StackPlan,
    axis: Axis,
    image_index: dict[str, int],
    coarse: NDArray[np.float32],
    sign: int,
) -> float | None:
    """Return the phase less what the code says, turns; None if the samples do not agree."""
    waves = samples.axis(plan, axis, image_index).waves[0]
    share = wrapped_coordinate(waves, 1.0, PhaseConvention(sign))[0]
    usable = np.isfinite(coarse) & samples.lit
    if plan.fringe_is_stripe:
        usable &= at_edges(coarse, plan.stripe)
    if not usable.any():
        return None
    turn = np.exp(2j * np.pi * (share[usable] - coarse[usable] / plan.periods[0])).mean()
    return float(np.angle(turn) / (2 * np.pi)) if abs(turn) >= CONCENTRATED else None


def at_edges(coarse: NDArray[np.float32], stripe: float) -> NDArray[np.bool_]:
    """Return the samples (...) that a coarse coordinate places at an edge of a stripe.

    Elsewhere in a stripe that is one fringe, it does not say which phase to expect.
    """
    return np.abs((coarse + 0.5) / stripe % 1 - 0.5) > EDGE


def periods_agree(
    images: AxisImages,
    plan: StackPlan,
    axis: Axis,
    coarse: NDArray[np.float32] | None,
    lit: NDArray[np.bool_],
) -> bool:
    """Tell whether each period's phase is, in the mean, that of the coarser coordinate."""
    if plan.heterodyne:
        return True  # they are unwrapped together, or not at all
    q = coarse
    most = 0.5 if plan.fringe_is_stripe else MAX_DEVIATION
    for period, waves in zip(plan.periods, images.waves, strict=True):
        fine, _ = wrapped_coordinate(waves, period, plan.phase)
        if q is None:
            q = unroll_coarsest(fine, period, plan.size[axis])
            continue
        usable = lit & np.isfinite(q)
        if plan.fringe_is_stripe:
            usable &= at_edges(q, plan.stripe)
        turn = np.exp(2j * np.pi * (q - fine)[usable] / period).mean() if usable.any() else 0
        if abs(turn) < CONCENTRATED or abs(np.angle(turn)) > 2 * np.pi * OFF_COARSER:
            return False
        q = refine(q, fine, period, most)
    return True

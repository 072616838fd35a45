"""Codes of other people: heterodyne phases, stripes as wide as fringes or of no whole width."""

import numpy as np
import pytest

from mitsuba_endo.decoding.gray_code import bit_images
from mitsuba_endo.decoding.heterodyne import separation, unwrap
from mitsuba_endo.decoding.phase_shift import PhaseConvention
from mitsuba_endo.decoding.stack import Stack, decode_stack
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.decoding.stack_reading import StackRequest, find_reading
from mitsuba_endo.errors import InputError
from tests.decoding.captures import SIZE, inner, photograph, view

SCENE = view()


def _read(plan: StackPlan, stack: Stack | None = None, **stated) -> tuple[np.ndarray, list[str]]:
    """Return the errors of a stack's lit pixels, NaN = not decoded, and the words found."""
    stack = stack or photograph(SCENE, patterns(plan))
    request = StackRequest(width=SIZE[0], height=SIZE[1], kind=plan.kind, **stated)
    reading = find_reading(stack, request)
    decoded = decode_stack(stack, reading.plan, order=reading.order)
    return (decoded.q - SCENE.rig.q)[inner(SCENE)], list(reading.words)


def _right(error: np.ndarray, most: float, share: float = 0.9) -> None:
    known = np.isfinite(error[:, 0])
    assert known.mean() > share
    assert np.median(np.abs(error[known]), axis=0).max() < most
    assert (np.abs(error[known]).max(1) < 2).mean() > 0.995


@pytest.mark.parametrize(
    ("periods", "steps"), [((21, 18, 16), 4), ((17.36, 16.0, 14.63), 3), ((17, 16), 3)]
)
@pytest.mark.parametrize("phase", [PhaseConvention(), PhaseConvention(-1, 0.75)])
def test_heterodyne(periods: tuple[float, ...], steps: int, phase: PhaseConvention):
    """Oracle: ray casting; three frequencies, and two of three steps, none spanning the pattern."""
    from dataclasses import replace

    plan = StackPlan.make("phase", *SIZE, periods=periods, steps=steps)
    assert plan.heterodyne
    stack = photograph(SCENE, patterns(replace(plan, phase=phase)), noise=0.002)
    error, words = _read(plan, stack, periods=periods)
    _right(error, 0.1)
    assert f"offset={phase.offset:g}" in words


def test_heterodyne_by_hand():
    """Oracle: 105 = 3 x 5 x 7 places have phases of their own; 106 are too many."""
    place = np.arange(105, dtype=np.float32)
    periods = (7.0, 5.0, 3.0)
    wrapped = [np.float32(place % period) for period in periods]
    np.testing.assert_allclose(unwrap(wrapped, periods, 105), place, atol=1e-4)
    assert separation(periods, 95) > 0.1
    assert separation(periods, 106) == pytest.approx(0, abs=1e-9)
    wrapped[0][30] += 0.5 * 7
    assert np.isnan(unwrap(wrapped, periods, 105)[30])


def test_periods_that_do_not_reach_are_refused():
    """Oracle: 20 and 16 repeat after 80 pixels; one period alone tells nothing."""
    for periods in ((20.0, 16.0), (16.0,)):
        with pytest.raises(InputError, match="do not tell all of the pattern's 262 pixels apart"):
            StackPlan.make("phase", *SIZE, periods=periods)


@pytest.mark.parametrize("stripe", [1.25, 2.6, 262 / 128])
def test_stripes_of_no_whole_width(stripe: float):
    """Oracle: ray casting; stripe k begins at the first whole pixel from k stripes on."""
    profile = bit_images(10, 2.5)
    index = [0, 0, 0, 1, 1, 2, 2, 2, 3, 3]
    gray = [k ^ k >> 1 for k in index]
    np.testing.assert_array_equal(profile, [[g >> 1 & 1 for g in gray], [g & 1 for g in gray]])
    plan = StackPlan.make("gray", *SIZE, stripe=stripe)
    error, _ = _read(plan, stripe=stripe)
    _right(error, 0.3)
    bias = np.nanmedian(error, axis=0)
    assert np.abs(bias).max() < 0.15


@pytest.mark.parametrize("phase", [PhaseConvention(), PhaseConvention(1, 0.75)])
@pytest.mark.parametrize("stated", [{"stripe": 16.0}, {}])
def test_stripes_that_are_fringes(phase: PhaseConvention, stated: dict):
    """Oracle: ray casting; at the stripes' edges the phase tells which fringe it is.

    With a sine the code begins a quarter of a fringe beside the phase's jump: it is refused,
    unless the images say which it is.
    """
    from dataclasses import replace

    plan = StackPlan.make("gray+phase", *SIZE, stripe=16)
    stack = photograph(SCENE, patterns(replace(plan, phase=phase)))
    error, words = _read(plan, stack, **stated)
    _right(error, 0.1)
    assert f"offset={phase.offset:g}" in words


def test_complementary_gray_code():
    """Oracle: its further image is the finest bit of stripes half as wide (Zhang 2012)."""
    stripe = StackPlan.make("gray+phase", *SIZE, stripe=16)
    halved = StackPlan.make("gray+phase", *SIZE, stripe=8)
    coarse, fine = bit_images(SIZE[0], 16), bit_images(SIZE[0], 8)
    np.testing.assert_array_equal(fine[:-1], coarse)
    assert len(halved.labels()) == len(stripe.labels()) + 2
    error, _ = _read(halved)
    _right(error, 0.1)


@pytest.mark.parametrize("kind", ["gray", "gray+phase", "phase"])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_one_direction_is_refused_by_name(kind: str, axis: str):
    """Oracle: the contract: a map needs both coordinates."""
    plan = StackPlan.make(kind, *SIZE)
    images = dict(zip(plan.labels(), patterns(plan), strict=True))
    one = [images[label] for label in ["white", "black", *plan.axis_labels(axis)]]
    stack = photograph(SCENE, one)
    for stated in (kind, None):
        with pytest.raises(InputError, match="only columns or only rows"):
            find_reading(stack, StackRequest(width=SIZE[0], height=SIZE[1], kind=stated))

"""Stacks in the orders, codes and phases of other people: read right, or refused, never wrong."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.decoding.conventions import (
    INVERSES,
    NOTHING,
    WORDS,
    StackConvention,
    StackOrder,
    orders,
    own_convention,
    read_convention,
)
from mitsuba_endo.decoding.gray_code import Code
from mitsuba_endo.decoding.phase_shift import PhaseConvention
from mitsuba_endo.decoding.possible_plans import possible_plans
from mitsuba_endo.decoding.stack import Stack, decode_stack
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import STEPS, STRIPES, StackPlan
from mitsuba_endo.decoding.stack_reading import StackReading, StackRequest, find_reading
from mitsuba_endo.errors import InputError, NothingDecodedError
from tests.decoding.captures import SIZE, View, inner, photograph, view

COSINE, SINE = PhaseConvention(1, 0), PhaseConvention(1, 0.75)
BACKWARD, FROM_STEP_ONE = PhaseConvention(-1, 0), PhaseConvention(1, 0.25)
CENTRED = PhaseConvention(1, round(-1 / 3 % 1, 9))
"""Of three steps: minus a third, none, a third of a turn."""
PLACES = ("first", "last", "swapped", "ends", "middle")
WRONG = 0.25
"""Pattern pixels of median error from which a map is wrong: a sine for a cosine is 4 off."""


@cache
def scene() -> View:
    return view()


@cache
def pictures(plan: StackPlan) -> Stack:
    return photograph(scene(), patterns(plan))


def shuffled(plan: StackPlan, order: StackOrder, place: str) -> Stack:
    """Return a plan's photographs in another order, white and black where ``place`` says."""
    at = {label: k for k, label in enumerate(plan.labels())}
    rest = [at[label] for label in order.labels(plan)]
    half = len(rest) // 2
    if plan.reference:
        rest = {
            "first": [0, 1, *rest],
            "last": [*rest, 0, 1],
            "swapped": [1, 0, *rest],
            "ends": [0, *rest, 1],
            "middle": [*rest[:half], 1, 0, *rest[half:]],
        }[place]
    whole = pictures(plan)
    return Stack(whole.images[rest], whole.saturated[rest], whole.levels)


def gray_stacks(code: Code, *, inverse: bool, reference: bool = True) -> Iterator[tuple]:
    plan = replace(StackPlan.make("gray", *SIZE, inverse=inverse, reference=reference), code=code)
    for k, order in enumerate(orders(plan, NOTHING)):
        yield plan, order, PLACES[k % 5]


def phase_stacks(kind: str, steps: int, phases: tuple, every: int) -> Iterator[tuple]:
    for shift, phase in enumerate(phases):
        inverse = kind == "gray+phase" and shift % 2 == 1
        plan = replace(StackPlan.make(kind, *SIZE, steps=steps, inverse=inverse), phase=phase)
        for k, order in enumerate(list(orders(plan, NOTHING))[shift::every]):
            yield plan, order, PLACES[k % 5]


FAMILIES = {
    "Gray": (*gray_stacks("gray", inverse=False), *gray_stacks("gray", inverse=True)),
    "binary": (*gray_stacks("binary", inverse=False), *[*gray_stacks("binary", inverse=True)][::4]),
    "no white": (
        *gray_stacks("gray", inverse=False, reference=False),
        *[*gray_stacks("gray", inverse=True, reference=False)][::6],
    ),
    "Gray and phase": (
        *phase_stacks("gray+phase", 4, (COSINE, SINE, BACKWARD), 9),
        *phase_stacks("gray+phase", 3, (CENTRED, FROM_STEP_ONE), 9),
    ),
    "phase": (
        *phase_stacks("phase", 4, (COSINE, SINE, BACKWARD), 1),
        *phase_stacks("phase", 3, (CENTRED,), 1),
    ),
}


def test_there_are_enough_combinations():
    """Oracle: the number that the documentation states."""
    assert sum(len(family) for family in FAMILIES.values()) >= 60


@pytest.mark.parametrize("name", FAMILIES)
def test_every_combination_is_read_right(name: str):
    """Oracle: ray casting, and the convention by which the images were ordered."""
    lit = inner(scene())
    for k, (plan, order, place) in enumerate(FAMILIES[name]):
        stack = shuffled(plan, order, place)
        kind = plan.kind if k % 3 else None
        reading = find_reading(stack, StackRequest(width=SIZE[0], height=SIZE[1], kind=kind))
        decoded = decode_stack(stack, reading.plan, order=reading.order)
        both = decoded.decoded & lit
        error = np.abs(decoded.q - scene().rig.q)[both]
        told = f"{plan.kind}, {plan.code}, {plan.phase}, {order}, {place}: {reading.words}"
        assert np.median(error, axis=0).max() < WRONG, told
        # Where several binary bits change at once, none is certain.
        assert both.sum() > (0.9 if plan.code == "gray" else 0.6) * lit.sum(), told
        wanted = StackConvention(order, plan.code, plan.phase.sign, plan.phase.offset)
        assert list(reading.words) == wanted.words(plan), told


def _read(stack: Stack, **stated) -> StackReading:
    return find_reading(stack, StackRequest(width=SIZE[0], height=SIZE[1], **stated))


@pytest.mark.parametrize("kind", ["gray", "phase", "gray+phase"])
def test_senseless_stacks_are_refused(kind):
    """Oracle: by construction: drawn by lot, one image twice, seen in a mirror, half turned."""
    plan = StackPlan.make(kind, *SIZE, inverse=kind == "gray")
    images = pictures(plan).images
    rng = np.random.default_rng(3)
    twice = images.copy()
    twice[5] = images[len(images) // 2 + 5]
    others = [
        images[rng.permutation(len(images))],
        twice,
        images[:, :, ::-1],
        images[:, ::-1],
        np.concatenate([images[: len(images) // 2], images[len(images) // 2 :, ::-1, ::-1]]),
    ]
    for wrong in others:
        with pytest.raises(InputError, match=r"none of|is mirrored"):
            _read(Stack(np.ascontiguousarray(wrong), wrong >= 1, 255), kind=kind)


def test_a_picture_of_something_else_is_refused():
    """Oracle: the contract: noise has no lit pixel that is steady, one image no pattern."""
    rng = np.random.default_rng(0)
    noise = rng.random((20, 190, 272)).astype(np.float32)
    with pytest.raises(InputError):
        _read(Stack(noise, noise >= 1, 255))
    still = np.repeat(noise[:1] * 0.3, 20, 0)
    with pytest.raises(NothingDecodedError, match="no pixel changes"):
        _read(Stack(still, still >= 1, 255))


def _turned_alike() -> tuple[StackPlan, Stack]:
    """Return a binary stack that reads as well upside down: all its codes are used."""
    plan = replace(StackPlan.make("gray", 128, 64, inverse=True), code="binary")
    images = np.stack(patterns(plan)).astype(np.float32) / 255 * 0.8 + 0.1
    return plan, Stack(images, images >= 1, 255)


def test_two_readings_alike_are_refused():
    """Oracle: exchanging binary bits and inverses turns the map by 180 degrees, which fits too."""
    plan, stack = _turned_alike()
    with pytest.raises(InputError, match="two readings alike") as refused:
        find_reading(stack, StackRequest(width=128, height=64))
    for word in ("pattern-first", "inverse-first"):
        assert word in str(refused.value)
    stated = read_convention("pattern-first")
    reading = find_reading(stack, StackRequest(width=128, height=64, convention=stated))
    decoded = decode_stack(stack, reading.plan, order=reading.order)
    y, x = np.mgrid[:64, :128]
    np.testing.assert_allclose(decoded.q, np.stack([x, y], -1), atol=0.01)
    assert reading.plan == plan


def test_what_is_stated_is_taken_at_its_word():
    """Oracle: a wrong statement fits no image; a right one changes nothing."""
    plan = StackPlan.make("gray", *SIZE)
    stack = pictures(plan)
    found = _read(stack)
    assert _read(stack, convention=read_convention("columns-first,gray-code")) == found
    assert _read(stack, reference="first", stripe=1, inverse=False) == found
    for wrong in ("rows-first", "fine-first", "binary-code"):
        with pytest.raises(InputError, match=r"none of|is mirrored"):
            _read(stack, convention=read_convention(wrong))
    with pytest.raises(InputError, match=r"none of|is mirrored"):
        _read(stack, reference="last")
    with pytest.raises(InputError, match="21 images"):
        _read(Stack(stack.images[:1].repeat(21, 0), stack.saturated[:1].repeat(21, 0), 255),
              kind="gray", reference="none", inverse=False)  # fmt: skip
    for useless in ("sine", "inverse-first"):
        with pytest.raises(InputError, match="does not have"):
            _read(stack, kind="gray", convention=read_convention(useless))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("upside-down", "upside-down"),
        ("rows-first,columns-first", "contradicts"),
        ("offset=a", "offset=a"),
        ("sine,cosine", "contradicts"),
    ],
)
def test_bad_words(text: str, named: str):
    """Oracle: the word that is wrong is named."""
    with pytest.raises(InputError, match=named):
        read_convention(text)


def test_bad_requests():
    """Oracle: the choice that is none is named."""
    for stated in ({"kind": "grey"}, {"reference": "middle"}):
        with pytest.raises(InputError, match=str(*stated.values())):
            StackRequest(width=8, height=8, **stated)


@pytest.mark.parametrize("kind", ["gray", "phase", "gray+phase"])
def test_words_state_everything(kind):
    """Oracle: words that were printed and given back leave one order."""
    for inverse in (False, True) if kind != "phase" else (False,):
        plan = StackPlan.make(kind, *SIZE, inverse=inverse)
        for order in orders(plan, NOTHING):
            words = StackConvention(order, "binary", -1, 0.25).words(plan)
            stated = read_convention(",".join(words))
            assert stated.fits(plan)
            assert [one.labels(plan) for one in orders(plan, stated)] == [order.labels(plan)]
            assert stated.allows("sign", -1)
            assert stated.allows("offset", 0.25)


def test_the_documentation_lists_every_word():
    """Oracle: the page of the commands, with the numbers of stripes and steps looked for."""
    page = (Path(__file__).parents[2] / "docs" / "commands.md").read_text("utf-8")
    for word in WORDS:
        assert f"`{word}`" in page, word
    assert f"({', '.join(map(str, STRIPES[:-1]))} or {STRIPES[-1]} pixels are looked for)" in page
    assert f"({min(STEPS)} to {max(STEPS)})" in page


def test_own_convention():
    """Oracle: the order in which the images are written."""
    for kind in ("gray", "gray+phase"):
        for inverse in (False, True):
            plan = StackPlan.make(kind, *SIZE, inverse=inverse)
            assert own_convention(plan).order.labels(plan) == plan.labels()[2:]
    assert {name for name in INVERSES if name != "none"} == {
        "after", "before", "axis-last", "axis-first", "last", "first",
    }  # fmt: skip


def test_plans_by_their_number_of_images():
    """Oracle: by hand: 2 x 9 bits, two references; seven and seven with two sets of four steps."""
    assert {plan.stripe for plan in possible_plans(20, 480, 384, kind="gray").plans} == {1, 16}
    phases = possible_plans(24, 480, 384, kind="gray+phase", stripe=4).plans
    assert [(plan.steps, plan.reference) for plan in phases] == [(4, True), (5, False)]
    with pytest.raises(InputError, match="25 images, but such patterns have 24, 26"):
        possible_plans(25, 61, 44, kind="gray", inverse=True)

"""Which images a structured-light stack holds, and in which order."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from ..errors import InputError
from .gray_code import Code, bit_count
from .heterodyne import separation
from .phase_shift import COSINE, PhaseConvention

Kind = Literal["gray", "phase", "gray+phase"]
Axis = Literal["x", "y"]
AXES: tuple[Axis, Axis] = ("x", "y")

FINEST_PERIOD = 16.0
"""Default period of the finest fringes, pattern pixels. Chosen: a camera as fine as the pattern has
16 pixels a fringe."""
MAX_RATIO = 6.0
"""Of neighbouring default periods: the coarser phase must tell which fringe the finer is in."""
STRIPES = (1, 2, 4, 8, 16, 32)
"""Narrowest stripes that are looked for, pattern pixels."""
STEPS = range(3, 13)
"""Phase steps per period that are looked for."""
LEAST_APART = 0.05
"""Turns by which the phases of two places must differ: twice the noise of bad photographs."""
SPARE = 1.1
"""Coarsest default period over the pattern's longer side, so that noise cannot wrap it."""


@dataclass(frozen=True)
class StackPlan:
    """The images of a stack, in this order: white and black; then all of x; then all of y.

    An axis has first its Gray bits from the coarsest to the finest, each followed by its inverse
    if there are inverses (the order of OpenCV's ``structured_light`` module), then for each
    period, from the coarsest to the finest, its phase steps, at any contrast. A bit 1 is white, and
    stripe 0 begins at the pattern's first pixel.

    Build one with :meth:`make`, which checks it and fills in what was not given.
    """

    kind: Kind
    width: int
    """Pattern pixels."""
    height: int
    reference: bool
    """The stack begins with a white and a black image."""
    inverse: bool
    """Each Gray bit is followed by its inverse."""
    stripe: float
    """Width of the narrowest Gray stripe, pattern pixels; 0 without Gray code. Stripe k begins at
    the first whole pixel from k stripes on."""
    periods: tuple[float, ...]
    """Pattern pixels, coarsest first; empty without phase."""
    steps: int
    """Phase steps per period; 0 without phase."""
    code: Code = "gray"
    """Of the stripes."""
    phase: PhaseConvention = COSINE
    """What the phase images show."""

    @classmethod
    def make(
        cls,
        kind: Kind,
        width: int,
        height: int,
        *,
        reference: bool = True,
        inverse: bool = False,
        stripe: float | None = None,
        periods: tuple[float, ...] | None = None,
        steps: int | None = None,
    ) -> "StackPlan":
        """Check a plan and fill in its defaults.

        Args:
            kind: "phase" is unwrapped from period to period, "gray+phase" by its Gray code.
            width: of the pattern, pixels.
            height: of the pattern, pixels.
            reference: a white and a black image come first.
            inverse: each Gray bit is followed by its inverse.
            stripe: narrowest Gray stripe; default 1, with phase the power of two that is at
                least a quarter and at most half of the period.
            periods: default for "phase" a ladder down to 16, for "gray+phase" 16.
            steps: default 4.

        Raises:
            InputError: a value out of range, or one that this kind of stack has no use for.
        """
        if kind not in get_args(Kind):
            raise InputError(f"unknown '{kind}'", "pattern", "choose gray, phase or gray+phase")
        for name, size in (("width", width), ("height", height)):
            if not 2 <= size <= 16384:
                raise InputError(f"{size} is out of range", f"pattern {name}", "give 2 to 16384")
        _refuse_unused(kind, inverse=inverse, stripe=stripe, periods=periods, steps=steps)
        periods = _checked_periods(kind, max(width, height), periods)
        steps = 0 if kind == "gray" else 4 if steps is None else steps
        if kind != "gray" and not 3 <= steps <= 64:
            raise InputError(f"{steps} is out of range", "phase steps", "give 3 to 64")
        stripe = _checked_stripe(kind, min(width, height), periods, stripe)
        return cls(kind, width, height, reference, inverse, stripe, periods, steps)

    @property
    def usual(self) -> bool:
        """Its stripe and its steps are those by default."""
        usual = StackPlan.make(self.kind, self.width, self.height, periods=self.periods or None)
        return (usual.stripe, usual.steps) == (self.stripe, self.steps)

    @property
    def heterodyne(self) -> bool:
        """No period spans the pattern: all of them together tell where a pixel lies."""
        return self.kind == "phase" and self.periods[0] < max(self.width, self.height)

    @property
    def fringe_is_stripe(self) -> bool:
        """Each stripe is one fringe, so that the code counts fringes and cannot halve them."""
        return self.kind == "gray+phase" and self.stripe == self.periods[0]

    @property
    def size(self) -> dict[Axis, int]:
        """Pattern pixels along each axis."""
        return {"x": self.width, "y": self.height}

    def bits(self, axis: Axis) -> int:
        """Gray bits of an axis."""
        return bit_count(self.size[axis], self.stripe) if self.stripe else 0

    def labels(self) -> list[str]:
        """Return what each image shows, e.g. ``x_gray07_inverse`` or ``y_phase16_step2``.

        Gray bits count down to ``gray00``, the finest.
        """
        return [*self.reference_labels(), *(label for a in AXES for label in self.axis_labels(a))]

    def reference_labels(self) -> list[str]:
        """Return the labels of the white and the black image, if there are any."""
        return ["white", "black"] if self.reference else []

    def axis_labels(self, axis: Axis) -> list[str]:
        """Return the labels of an axis's images."""
        bits = self.bit_labels(axis)
        inverses = self.inverse_labels(axis) if self.inverse else [None] * len(bits)
        stripes = [label for pair in zip(bits, inverses, strict=True) for label in pair if label]
        return stripes + [label for steps in self.phase_labels(axis) for label in steps]

    def bit_labels(self, axis: Axis) -> list[str]:
        """Return the labels of the bits' images, coarsest first."""
        return [f"{axis}_gray{bit:02d}" for bit in reversed(range(self.bits(axis)))]

    def inverse_labels(self, axis: Axis) -> list[str]:
        """Return the labels of their inverses, likewise."""
        return [f"{label}_inverse" for label in self.bit_labels(axis)]

    def phase_labels(self, axis: Axis) -> list[list[str]]:
        """Return the labels of the steps of each period, coarsest first."""
        return [[f"{axis}_phase{p:g}_step{k}" for k in range(self.steps)] for p in self.periods]


def _refuse_unused(kind: Kind, **given: object) -> None:
    unused = {"gray": ("periods", "steps"), "phase": ("inverse", "stripe"), "gray+phase": ()}[kind]
    for name in unused:
        if given[name] not in (None, False):
            raise InputError(f"a {kind} stack has none", name, "leave it out")


def _checked_periods(
    kind: Kind, extent: int, periods: tuple[float, ...] | None
) -> tuple[float, ...]:
    if kind == "gray":
        return ()
    if periods is None:
        return default_periods(extent) if kind == "phase" else (FINEST_PERIOD,)
    if not periods or not all(math.isfinite(p) and p >= 2 for p in periods):
        raise InputError("not all are 2 pattern pixels or more", "periods", "correct them")
    if list(periods) != sorted(set(periods), reverse=True):
        raise InputError("they do not fall", "periods", "give them from the coarsest to the finest")
    if kind == "gray+phase" and len(periods) != 1:
        raise InputError(f"{len(periods)} given", "periods", "a gray+phase stack has one")
    if kind == "phase" and periods[0] < extent and separation(periods, extent) < LEAST_APART:
        raise InputError(
            f"they do not tell all of the pattern's {extent} pixels apart", "periods",
            "begin with one that spans the pattern, take others, or use gray+phase",
        )  # fmt: skip
    return tuple(float(p) for p in periods)


def default_periods(extent: int) -> tuple[float, ...]:
    """Return whole periods from beyond ``extent`` pattern pixels down to the finest one."""
    coarsest = max(math.ceil(SPARE * extent), 2 * FINEST_PERIOD)
    levels = math.ceil(math.log(coarsest / FINEST_PERIOD) / math.log(MAX_RATIO))
    ratio = (coarsest / FINEST_PERIOD) ** (1 / levels)
    return tuple(float(round(FINEST_PERIOD * ratio**k)) for k in reversed(range(levels + 1)))


def _checked_stripe(
    kind: Kind, extent: int, periods: tuple[float, ...], stripe: float | None
) -> float:
    if kind == "phase":
        return 0
    if stripe is None:
        return 1 if kind == "gray" else min(2 ** int(math.log2(periods[0] / 2)), extent // 2)
    if not 1 <= stripe <= extent // 2:
        raise InputError(f"{stripe:g} is out of range", "stripe", f"give 1 to {extent // 2}")
    if kind == "gray+phase" and stripe > periods[0] / 2 and stripe != periods[0]:
        raise InputError(
            f"{stripe:g} pixels cannot tell fringes of {periods[0]:g} pixels apart", "stripe",
            "give the period, or at most half of it",
        )  # fmt: skip
    return stripe

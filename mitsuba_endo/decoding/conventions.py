"""In which order the images of a stack come, and what its words mean."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import product
from typing import Literal, TypeVar

from ..errors import InputError
from .gray_code import Code
from .stack_plan import AXES, Axis, StackPlan

T = TypeVar("T")
Inverses = Literal["none", "after", "before", "axis-last", "axis-first", "last", "first"]
INVERSES: dict[Inverses, str] = {
    "none": "",
    "after": "pattern-first",
    "before": "inverse-first",
    "axis-last": "inverses-after-axis",
    "axis-first": "inverses-before-axis",
    "last": "inverses-last",
    "first": "inverses-first",
}
"""Where the inverses stand: beside each pattern, after or before those of an axis, or of all."""


@dataclass(frozen=True)
class StackOrder:
    """The order of a stack's images, but for its white and black one."""

    rows_first: bool = False
    """The images of y come before those of x."""
    fine_first: bool = False
    """The finest bit, and the finest period, comes first."""
    inverses: Inverses = "none"
    by_axis: bool = True
    """All of one axis, then all of the other; else all bits and then all phases, or vice versa."""
    phase_first: bool = False
    """Phase images come before the bits."""

    def labels(self, plan: StackPlan) -> list[str]:
        """Return what the images show in this order, without white and black."""
        axes: tuple[Axis, ...] = AXES[::-1] if self.rows_first else AXES
        kinds = ("phase", "bits") if self.phase_first else ("bits", "phase")
        groups = [[self._group(plan, axis, kind) for kind in kinds] for axis in axes]
        if not self.by_axis:
            groups = zip(*groups, strict=True)
        labels = [label for group in groups for part in group for label in part]
        if self.inverses not in ("last", "first"):
            return labels
        inverses = [label for axis in axes for label in self._turned(plan.inverse_labels(axis))]
        return labels + inverses if self.inverses == "last" else inverses + labels

    def _group(self, plan: StackPlan, axis: Axis, kind: str) -> list[str]:
        if kind == "phase":
            return [label for steps in self._turned(plan.phase_labels(axis)) for label in steps]
        bits = self._turned(plan.bit_labels(axis))
        inverses = self._turned(plan.inverse_labels(axis))
        pairs = list(zip(bits, inverses, strict=True))
        return {
            "after": [label for pair in pairs for label in pair],
            "before": [label for pair in pairs for label in pair[::-1]],
            "axis-last": bits + inverses,
            "axis-first": inverses + bits,
        }.get(self.inverses, bits)

    def _turned(self, coarse_first: list[T]) -> list[T]:
        return coarse_first[::-1] if self.fine_first else coarse_first


@dataclass(frozen=True)
class StackConvention:
    """Everything that a stack's images do not say by themselves."""

    order: StackOrder
    code: Code = "gray"
    sign: int = 1
    """Of the phase's shifts; see :class:`PhaseConvention`."""
    offset: float = 0.0
    """Of the phase, turns."""

    def words(self, plan: StackPlan) -> list[str]:
        """Return the words that state this convention for a stack of this plan."""
        order = self.order
        words = ["rows-first" if order.rows_first else "columns-first"]
        if plan.stripe:
            words.append(f"{self.code}-code")
        if plan.stripe or len(plan.periods) > 1:
            words.append("fine-first" if order.fine_first else "coarse-first")
        if plan.inverse:
            words.append(INVERSES[order.inverses])
        if plan.kind == "gray+phase":
            words.append("phase-first" if order.phase_first else "bits-first")
            words.append("by-axis" if order.by_axis else "by-kind")
        if plan.periods:
            words.append("shift-forward" if self.sign > 0 else "shift-backward")
            words.append(f"offset={round(self.offset % 1, 4):g}")
        return words


def own_convention(plan: StackPlan) -> StackConvention:
    """Return the convention of the images that the package writes."""
    return StackConvention(StackOrder(inverses="after" if plan.inverse else "none"))


WORDS: dict[str, tuple[str, object]] = {
    "columns-first": ("rows_first", False),
    "rows-first": ("rows_first", True),
    "coarse-first": ("fine_first", False),
    "fine-first": ("fine_first", True),
    **{word: ("inverses", name) for name, word in INVERSES.items() if word},
    "by-axis": ("by_axis", True),
    "by-kind": ("by_axis", False),
    "bits-first": ("phase_first", False),
    "phase-first": ("phase_first", True),
    "gray-code": ("code", "gray"),
    "binary-code": ("code", "binary"),
    "shift-forward": ("sign", 1),
    "shift-backward": ("sign", -1),
    "cosine": ("offset", 0.0),
    "sine": ("offset", 0.75),
    "negative-cosine": ("offset", 0.5),
    "negative-sine": ("offset", 0.25),
}
"""What each word states. ``offset=TURNS`` states any phase."""
OPTION = "--convention"


@dataclass(frozen=True)
class Stated:
    """What is stated of a convention, by the names of its parts."""

    parts: tuple[tuple[str, object], ...] = ()

    def allows(self, name: str, value: object) -> bool:
        """Tell whether a part may have a value."""
        return all(value == wanted for part, wanted in self.parts if part == name)

    def fits(self, plan: StackPlan) -> bool:
        """Tell whether a stack of this plan has all the parts that are stated."""
        has = {
            "rows_first": True,
            "fine_first": plan.stripe > 0 or len(plan.periods) > 1,
            "inverses": plan.inverse,
            "by_axis": plan.kind == "gray+phase",
            "phase_first": plan.kind == "gray+phase",
            "code": plan.stripe > 0,
            "sign": bool(plan.periods),
            "offset": bool(plan.periods),
        }
        return all(has[name] for name, _ in self.parts)


NOTHING = Stated()


def read_convention(text: str) -> Stated:
    """Read words, separated by commas; see WORDS.

    Raises:
        InputError: an unknown word, or two that contradict each other.
    """
    parts: dict[str, object] = {}
    for word in filter(None, (part.strip() for part in text.split(","))):
        name, value = _stated(word)
        if parts.setdefault(name, value) != value:
            raise InputError(f"'{word}' contradicts another word", OPTION, "state one of both")
    return Stated(tuple(parts.items()))


def _stated(word: str) -> tuple[str, object]:
    if word in WORDS:
        return WORDS[word]
    if word.startswith("offset="):
        try:
            return "offset", float(word.removeprefix("offset=")) % 1
        except ValueError:
            pass
    raise InputError(f"unknown '{word}'", OPTION, f"choose from {', '.join(WORDS)}, offset=TURNS")


def orders(plan: StackPlan, stated: Stated) -> Iterator[StackOrder]:
    """Yield the orders that a plan's images may come in, each once, the commonest first."""
    both = (False, True)
    inverses = [name for name in INVERSES if (name != "none") == plan.inverse]
    mixed = plan.kind == "gray+phase"
    choices = {
        "rows_first": both,
        "fine_first": both if plan.stripe or len(plan.periods) > 1 else (False,),
        "inverses": inverses,
        "by_axis": (True, False) if mixed else (True,),
        "phase_first": both if mixed else (False,),
    }
    assert list(choices) == [field.name for field in fields(StackOrder)]
    yielded = set()
    for values in product(*choices.values()):
        if all(stated.allows(*pair) for pair in zip(choices, values, strict=True)):
            order = StackOrder(*values)
            labels = tuple(order.labels(plan))
            if labels not in yielded:
                yielded.add(labels)
                yield order

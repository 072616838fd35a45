"""Values of a configuration that are drawn anew for every sample.

Written in YAML as a fixed value (``3.2``), a uniform range (``[2, 5]``), or a mapping of one key:
``{log: [2, 5]}`` uniform in the logarithm, ``{uniform: [[r, g, b], [r, g, b]]}`` with vectors,
``{choose: [a, b, c]}`` one of several, ``{value: [1, 2]}`` a fixed value that is a list.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, PlainSerializer

from ..records.validation import Record

FORMS = ("value", "uniform", "log", "choose")


class Section(Record):
    """Base of a configuration's parts: their defaults are checked as a user's values are."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True
    )


@dataclass(frozen=True)
class Range:
    """What one value of a sample is drawn from."""

    form: Literal["value", "uniform", "log", "choose"]
    values: tuple[Any, ...]
    """The value, the two ends, or the choices."""
    integer: bool = False
    """Whether only whole numbers are drawn, both ends included."""

    def draw(self, rng: np.random.Generator) -> Any:
        """Return one value; nothing is taken from ``rng`` for a fixed one."""
        if self.form == "value":
            return self.values[0]
        if self.form == "choose":
            return self.values[int(rng.integers(len(self.values)))]
        low, high = (np.asarray(end, float) for end in self.values)
        if self.integer:
            return int(rng.integers(int(low), int(high), endpoint=True))
        share = rng.random(low.shape)
        if self.form == "log":
            drawn = np.exp((1 - share) * np.log(low) + share * np.log(high))
        else:
            drawn = (1 - share) * low + share * high
        return drawn.tolist()

    def plain(self) -> Any:
        """Return it as it would be written in YAML."""
        if self.form == "value":
            value = self.values[0]
            return {"value": value} if isinstance(value, list | dict) else value
        if self.form == "uniform" and all(map(_is_number, self.values)):
            return list(self.values)
        return {self.form: list(self.values)}


def fixed(value: Any) -> Range:
    """Return the range of one value."""
    return Range("value", (value,))


def uniform(low: Any, high: Any) -> Range:
    """Return the range of all values between two numbers or vectors."""
    return Range("uniform", (low, high))


def log(low: float, high: float) -> Range:
    """Return the range of all values between two numbers, small ones as often as large ones."""
    return Range("log", (low, high))


def choose(*values: Any) -> Range:
    """Return the range of a few values; one given twice is drawn twice as often."""
    return Range("choose", values)


def draw_all(named: Mapping[str, Range], rng: np.random.Generator) -> dict[str, Any]:
    """Return a value for every name, whatever order they are written in."""
    return {name: named[name].draw(rng) for name in sorted(named)}


def parse(raw: Any) -> Range:
    """Read a range from its YAML form.

    Raises:
        ValueError: what is wrong; what to do.
    """
    if isinstance(raw, Range):
        return raw
    if isinstance(raw, Mapping):
        return _parse_mapping(raw)
    if isinstance(raw, list | tuple) and len(raw) == 2 and all(map(_is_number, raw)):
        return _range("uniform", raw)
    return fixed(raw)


def is_range(raw: Any) -> bool:
    """Tell whether a YAML value is a range rather than a mapping of names to ranges."""
    return not isinstance(raw, Mapping) or (len(raw) == 1 and next(iter(raw)) in FORMS)


def _parse_mapping(raw: Mapping[str, Any]) -> Range:
    if not is_range(raw):
        raise ValueError(f"{dict(raw)!r} is not a range; write one of {', '.join(FORMS)}")
    form, values = next(iter(raw.items()))
    if form == "value":
        return fixed(values)
    if form == "choose":
        if not isinstance(values, list | tuple) or not values:
            raise ValueError("nothing to choose from; give a list of values")
        return choose(*values)
    return _range(form, values)


def _range(form: Any, values: Any) -> Range:
    try:
        low, high = (np.asarray(end, float) for end in values)
    except (TypeError, ValueError):
        raise ValueError(f"{values!r} is not a pair of numbers; give [lowest, highest]") from None
    if low.shape != high.shape or low.ndim > 1 or not np.isfinite([low, high]).all():
        raise ValueError(f"{values!r} has no finite ends of one kind; give [lowest, highest]")
    if (low > high).any():
        raise ValueError(f"{values!r} runs backwards; give [lowest, highest]")
    if form == "log" and (low <= 0).any():
        raise ValueError(f"{values!r} has no logarithm; give positive ends")
    return Range(form, tuple(values))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(low: float, high: float, integer: bool = False) -> AfterValidator:
    """Return a check that only numbers within [low, high] can be drawn."""

    def check(range_: Range) -> Range:
        for value in range_.values:
            if not _is_number(value) or (integer and value != int(value)):
                kind = "whole number" if integer else "number"
                raise ValueError(f"{value!r} is not a {kind}; give one, or [lowest, highest]")
            if not low <= value <= high:
                raise ValueError(f"{value:g} is out of range; stay within {low:g} and {high:g}")
        return replace(range_, integer=integer)

    return AfterValidator(check)


def _names(range_: Range) -> Range:
    if range_.form not in ("value", "choose") or not all(isinstance(v, str) for v in range_.values):
        raise ValueError(f"{range_.plain()!r} is not a name; give one, or {{choose: [a, b]}}")
    return range_


_PARSED = BeforeValidator(parse)
_PLAIN = PlainSerializer(Range.plain)

Anything = Annotated[Range, _PARSED, _PLAIN]
Names = Annotated[Range, _PARSED, _PLAIN, AfterValidator(_names)]
Number = Annotated[Range, _PARSED, _PLAIN, _numbers(-1e9, 1e9)]
Positive = Annotated[Range, _PARSED, _PLAIN, _numbers(1e-9, 1e9)]
NonNegative = Annotated[Range, _PARSED, _PLAIN, _numbers(0, 1e9)]
Share = Annotated[Range, _PARSED, _PLAIN, _numbers(0, 1)]
Degrees = Annotated[Range, _PARSED, _PLAIN, _numbers(-360, 360)]
Count = Annotated[Range, _PARSED, _PLAIN, _numbers(0, 2**31 - 1, integer=True)]

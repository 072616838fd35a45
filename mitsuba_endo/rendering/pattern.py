"""Laser patterns as images: what the DOE is made to project."""

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError
from pydantic.dataclasses import dataclass

from ..decoding.grid_pattern import COLOURS, CodedGrid
from ..errors import InputError
from ..shapes.registry import CHECKED, Positive


@dataclass(frozen=True, kw_only=True, config=CHECKED)
class GridPattern:
    """A plain grid of bright lines, centred in the pattern."""

    width: Annotated[int, Field(ge=2, le=8192)] = 480
    """Pattern pixels."""
    height: Annotated[int, Field(ge=2, le=8192)] = 384
    period: Positive = 12.0
    """Distance of the lines, pattern pixels."""
    line: Annotated[float, Field(gt=0, lt=0.5)] = 0.06
    """Standard deviation of a line's Gaussian profile, in periods."""
    background: Annotated[float, Field(ge=0, lt=1)] = 0.02
    """Light between the lines relative to them: the DOE's stray light."""
    oversample: Annotated[int, Field(ge=1, le=8)] = 2
    """Texels per pattern pixel along each axis."""
    colour: Literal["green", "white"] = "green"

    def image(self) -> NDArray[np.float32]:
        """Return the linear RGB image (height oversample, width oversample, 3)."""
        columns, rows = (self._profile(n) for n in (self.width, self.height))
        bright = np.maximum(columns[None, :], rows[:, None])
        bright = self.background + (1 - self.background) * bright
        return (bright[..., None] * np.array(COLOURS[self.colour])).astype(np.float32)

    def _profile(self, size: int) -> NDArray[np.float64]:
        texel = (np.arange(size * self.oversample) + 0.5) / self.oversample - 0.5
        from_middle = (texel - (size - 1) / 2) / self.period
        return np.exp(-0.5 * ((from_middle - np.round(from_middle)) / self.line) ** 2)


PATTERNS: dict[str, type[GridPattern] | type[CodedGrid]] = {
    "grid": GridPattern,
    "coded": CodedGrid,
}
"""Every pattern that a scene can ask for, by name."""


def make_pattern(name: str, **parameters: Any) -> NDArray[np.float32]:
    """Return the linear RGB image (H, W, 3) of the pattern called ``name``.

    Raises:
        InputError: as :func:`parse_pattern`.
    """
    return parse_pattern(name, **parameters).image()


def parse_pattern(name: str, **parameters: Any) -> GridPattern | CodedGrid:
    """Return the record of the pattern called ``name``.

    Raises:
        InputError: unknown pattern, unknown parameter, or a value that is out of range.
    """
    if name not in PATTERNS:
        names = ", ".join(sorted(PATTERNS))
        raise InputError(
            f"there is no pattern called {name!r}", "pattern", f"choose one of {names}"
        )
    try:
        return PATTERNS[name](**parameters)
    except ValidationError as error:
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        raise InputError(
            f"{first['msg'][0].lower()}{first['msg'][1:]}, not {first['input']!r}",
            f"pattern {name}: {field}",
            f"the parameters are {', '.join(PATTERNS[name].__dataclass_fields__)}",
        ) from None

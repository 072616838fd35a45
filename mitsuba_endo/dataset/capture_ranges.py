"""Ranges of everything that a photograph's settings hold, by their names in those settings."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic.fields import FieldInfo

from ..capture.settings import CaptureSettings, Effects, Light, Tissue
from ..records.validation import Record
from .ranges import Anything, Section, choose, draw_all, log, uniform

Ranges = dict[str, Anything]


TISSUE: Ranges = {
    "base_color": uniform([0.62, 0.26, 0.20], [0.85, 0.50, 0.44]),
    "roughness": uniform(0.3, 0.5),
    "clearcoat": uniform(0.2, 0.9),
    "clearcoat_gloss": uniform(0.8, 0.95),
    "vessel_contrast": uniform(0.2, 0.7),
    "vessel_scale": uniform(4.0, 9.0),
    "relief": uniform(0.05, 0.2),
    "mean_free_path": uniform(0.1, 0.4),
    "seed": uniform(0, 999_999),
}
"""Units are those of :class:`~mitsuba_endo.capture.settings.Tissue`; about its defaults."""
LIGHT: Ranges = {"lamp": choose(0.0, 0.0, 0.01, 0.03, 0.1)}
"""Relative to the pattern; off in two of five."""
EFFECTS: Ranges = {
    "vignetting": uniform(0.3, 1.2),
    "defocus": uniform(0.2, 0.8),
    "motion": choose(0.0, 0.0, 0.0, 0.7, 1.5),
    "motion_angle": uniform(-3.14159, 3.14159),
    "speckle_contrast": uniform(0.05, 0.3),
    "speckle_grain": uniform(1.0, 2.2),
    "exposure": log(0.8, 2.5),
    "shot": log(2500.0, 30000.0),
    "read_noise": uniform(3.0, 25.0),
    "jpeg_quality": choose(None, None, 90, 70),
}
"""Units are those of :class:`~mitsuba_endo.capture.settings.Effects`; from clean to moderate."""


class CaptureRanges(Section):
    """Settings of the photographs.

    Keys left out of a section have the defaults of :mod:`mitsuba_endo.capture.settings`.
    """

    tissue: Ranges = TISSUE
    light: Ranges = LIGHT
    effects: Ranges = EFFECTS
    spp: Annotated[int, Field(ge=1)] = 16
    """Samples per pixel."""
    max_depth: Annotated[int, Field(ge=2)] = 4
    """Longest light path, see :class:`~mitsuba_endo.capture.settings.CaptureSettings`."""

    @field_validator("tissue")
    @classmethod
    def _tissue(cls, value: Ranges) -> Ranges:
        return _checked(Tissue, value)

    @field_validator("light")
    @classmethod
    def _light(cls, value: Ranges) -> Ranges:
        return _checked(Light, value)

    @field_validator("effects")
    @classmethod
    def _effects(cls, value: Ranges) -> Ranges:
        return _checked(Effects, value)

    @model_validator(mode="after")
    def _fit_together(self) -> "CaptureRanges":
        first: dict[str, dict[str, Any]] = {
            section: {name: range_.values[0] for name, range_ in getattr(self, section).items()}
            for section in ("tissue", "light", "effects")
        }
        try:
            CaptureSettings.model_validate(first)
        except ValidationError as error:
            raise ValueError(_reason(error)) from None
        return self

    def draw(self, rng: np.random.Generator) -> CaptureSettings:
        """Return the settings of one photograph."""
        drawn = {
            section: draw_all(getattr(self, section), rng)
            for section in ("tissue", "light", "effects")
        }
        return CaptureSettings.model_validate(
            {**drawn, "spp": self.spp, "max_depth": self.max_depth}
        )


def _checked(model: type[Record], given: Ranges) -> Ranges:
    """Return the ranges, those of whole numbers marked, once both ends of each have passed."""
    checked = {}
    for name, range_ in given.items():
        field = model.model_fields.get(name)
        if field is None:
            names = ", ".join(model.model_fields)
            raise ValueError(f"there is no '{name}'; choose among {names}")
        for value in range_.values:
            try:
                model.model_validate({name: value})
            except ValidationError as error:
                raise ValueError(f"{name}: {_reason(error)}") from None
        checked[name] = replace(range_, integer=range_.form == "uniform" and _is_whole(field))
    return checked


def _is_whole(field: FieldInfo) -> bool:
    annotation: Any = field.annotation
    kinds = getattr(annotation, "__args__", (annotation,))
    return any(kind is int or getattr(kind, "__origin__", None) is int for kind in kinds)


def _reason(error: ValidationError) -> str:
    first = error.errors()[0]
    message = first["msg"].removeprefix("Value error, ")
    return message[0].lower() + message[1:]

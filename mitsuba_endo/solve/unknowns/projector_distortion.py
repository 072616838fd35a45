"""Lens distortion of the projector."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.brown_distortion import BrownDistortion
from ...records.rig import Rig
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, Value, VectorBlock, register_block

_LEAST_TERMS = 2
"""Coefficients that are unknowns where the rig names none: k1 and k2."""

_STD = (0.005, 0.01, 0.001, 0.001, 0.01)
"""Of a careful calibration, of k1, k2, p1, p2, k3; they have no unit."""


@register_block
class Distortion(VectorBlock):
    """(k1, k2[, p1, p2, k3]) on the projection model's normalised coordinates."""

    name: ClassVar[str] = "distortion"
    words: ClassVar[str] = "projector distortion"
    order: ClassVar[int] = 33
    part_names: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")

    def given(self, rig: Rig) -> Floats:
        coefficients = rig.projector.distortion
        least = 0 if self.sharing(rig) == "fixed" else _LEAST_TERMS
        return np.array([*coefficients, *[0.0] * (least - len(coefficients))])

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        return replace(model, projector=model.projector.with_(distortion=BrownDistortion(value)))

    def doubt(self, rig: Rig, value: Value) -> Floats:
        return np.diag(1 / np.array(_STD[: len(value)]))

"""Principal point of the projector."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...records.rig import Rig
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, NaturalScales, Value, VectorBlock, register_block

_STD_PX = 3.0
"""Of a careful calibration, pattern pixels."""


@register_block
class Centre(VectorBlock):
    """(cx, cy), pattern pixels."""

    name: ClassVar[str] = "centre"
    words: ClassVar[str] = "projector centre"
    unit: ClassVar[str] = "px"
    order: ClassVar[int] = 31
    part_names: ClassVar[tuple[str, ...]] = ("x", "y")
    rate: ClassVar[float] = 0.3

    def given(self, rig: Rig) -> Floats:
        return np.array(rig.projector.centre or rig.projector.middle, float)

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        return replace(model, projector=model.projector.with_(centre=(value[0], value[1])))

    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        return np.full(2, scene.focal)

    def prior_std(self, rig: Rig, value: Value) -> Floats | None:
        std = rig.projector.centre_std
        return None if std is None else np.array(std, float)

    def doubt(self, rig: Rig, value: Value) -> Floats:
        std = self.prior_std(rig, value)
        return np.diag(1 / (np.full(2, _STD_PX) if std is None else std))

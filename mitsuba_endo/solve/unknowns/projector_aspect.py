"""Aspect ratio of the projector."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.arrays import namespace
from ...records.rig import Rig
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, LogarithmBlock, Value, register_block

_STD = 0.001
"""Of a careful calibration, relative."""


@register_block
class Aspect(LogarithmBlock):
    """(log fy / fx)."""

    name: ClassVar[str] = "aspect"
    words: ClassVar[str] = "aspect ratio"
    order: ClassVar[int] = 32

    def given(self, rig: Rig) -> Floats:
        return np.log([rig.projector.aspect])

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        aspect = namespace(value[0]).exp(value[0])
        return replace(model, projector=model.projector.with_(aspect=aspect))

    def doubt(self, rig: Rig, value: Value) -> Floats:
        return np.eye(1) / _STD

"""Aspect ratio of the projector."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.arrays import namespace
from ...records.rig import Rig
from ...rendering.coordinates import FrameModel
from .block import Floats, LogarithmBlock, register_block


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

"""Focal length of the projector."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.arrays import namespace
from ...records.rig import Rig, Sharing
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, LogarithmBlock, register_block


@register_block
class ProjectorFocal(LogarithmBlock):
    """(log f), f in pattern pixels."""

    name: ClassVar[str] = "focal"
    words: ClassVar[str] = "focal length"
    unit: ClassVar[str] = "px"
    order: ClassVar[int] = 30

    def given(self, rig: Rig) -> Floats | None:
        value = rig.projector.focal.value
        return None if value is None else np.log([value])

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        focal = namespace(value[0]).exp(value[0])
        return replace(model, projector=model.projector.with_(focal=focal))

    def sharing(self, rig: Rig) -> Sharing:
        return rig.share.focal or ("shared" if rig.projector.focal.refine else "fixed")

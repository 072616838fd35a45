"""Principal point of the camera."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...records.rig import Rig, Sharing
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, NaturalScales, Value, VectorBlock, register_block

_STD_PX = 1.0
"""Of a careful calibration, camera pixels."""


@register_block
class CameraCentre(VectorBlock):
    """(cx, cy), pixels."""

    name: ClassVar[str] = "camera_centre"
    words: ClassVar[str] = "camera centre"
    unit: ClassVar[str] = "px"
    order: ClassVar[int] = 41
    modes: ClassVar[tuple[Sharing, ...]] = ("fixed", "shared")
    part_names: ClassVar[tuple[str, ...]] = ("x", "y")
    rate: ClassVar[float] = 0.3

    def given(self, rig: Rig) -> Floats:
        return np.array(rig.camera.K, float)[:2, 2]

    def holds(self, model: FrameModel, value: Value) -> bool:
        K = model.camera.K
        return bool(value[0] == K[0][2] and value[1] == K[1][2])

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        (fx, _, _), (_, fy, _), last = model.camera.K
        K = ((fx, 0.0, value[0]), (0.0, fy, value[1]), tuple(last))
        return replace(model, camera=replace(model.camera, K=K))

    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        return np.full(2, scene.camera_focal)

    def prior_std(self, rig: Rig, value: Value) -> Floats | None:
        std = rig.camera.K_std
        return None if std is None else np.array(std[2:], float)

    def doubt(self, rig: Rig, value: Value) -> Floats:
        std = self.prior_std(rig, value)
        return np.diag(1 / (np.full(2, _STD_PX) if std is None else std))

"""Lens distortion of the camera."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.cameras import CAMERAS
from ...records.rig import Rig, Sharing
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, Value, VectorBlock, register_block

_STD = {"k1": 0.005, "k2": 0.01, "p1": 0.001, "p2": 0.001}
_OTHER_STD = 0.01
"""Of a careful calibration; a coefficient has no unit."""


@register_block
class CameraDistortion(VectorBlock):
    """The coefficients of the camera's model, in the order of the rig file."""

    name: ClassVar[str] = "camera_distortion"
    words: ClassVar[str] = "camera distortion"
    order: ClassVar[int] = 42
    modes: ClassVar[tuple[Sharing, ...]] = ("fixed", "shared")

    def given(self, rig: Rig) -> Floats:
        coefficients = rig.camera.distortion
        count = len(coefficients)
        if self.sharing(rig) != "fixed":
            count = rig.camera.unknown_coefficients
        return np.array([*coefficients, *[0.0] * (count - len(coefficients))])

    def names(self, rig: Rig) -> tuple[str, ...]:
        return CAMERAS[rig.camera.model].coefficients[: len(self.given(rig))]

    def holds(self, model: FrameModel, value: Value) -> bool:
        return bool(np.array_equal(value, np.array(model.camera.distortion, float)))

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        return replace(model, camera=replace(model.camera, distortion=tuple(value)))

    def prior_std(self, rig: Rig, value: Value) -> Floats | None:
        std = rig.camera.distortion_std
        if std is None:
            return None
        return np.array(std[: len(value)]) if isinstance(std, list) else np.full(len(value), std)

    def doubt(self, rig: Rig, value: Value) -> Floats:
        std = self.prior_std(rig, value)
        if std is None:
            names = self.names(rig)
            std = np.array([_STD.get(name, _OTHER_STD) for name in names])
        return np.diag(1 / std)

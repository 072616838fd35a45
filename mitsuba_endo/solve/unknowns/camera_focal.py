"""Focal lengths of the camera."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.arrays import namespace
from ...records.rig import Rig, Sharing
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, LogarithmBlock, Suspect, Value, register_block

_FOCAL_STD, _ASPECT_STD = 0.003, 0.001
"""Of a careful calibration, relative."""


@register_block
class CameraFocal(LogarithmBlock):
    """(log fx, log fy), pixels."""

    name: ClassVar[str] = "camera_focal"
    words: ClassVar[str] = "camera focal length"
    unit: ClassVar[str] = "px"
    order: ClassVar[int] = 40
    modes: ClassVar[tuple[Sharing, ...]] = ("fixed", "shared")
    part_names: ClassVar[tuple[str, ...]] = ("x", "y")

    def given(self, rig: Rig) -> Floats:
        return np.log(np.diag(np.array(rig.camera.K, float))[:2])

    def holds(self, model: FrameModel, value: Value) -> bool:
        K = model.camera.K
        return bool(np.array_equal(value, np.log([float(K[0][0]), float(K[1][1])])))

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        exp = namespace(value[0]).exp
        (_, _, cx), (_, _, cy), last = model.camera.K
        K = ((exp(value[0]), 0.0, cx), (0.0, exp(value[1]), cy), tuple(last))
        return replace(model, camera=replace(model.camera, K=K))

    def prior_std(self, rig: Rig, value: Value) -> Floats | None:
        std = rig.camera.K_std
        return None if std is None else np.array(std[:2]) / np.exp(value)

    def doubt(self, rig: Rig, value: Value) -> Floats:
        std = self.prior_std(rig, value)
        if std is not None:
            return np.diag(1 / std)
        return np.array([[0.5 / _FOCAL_STD, 0.5 / _FOCAL_STD], [-1 / _ASPECT_STD, 1 / _ASPECT_STD]])

    def suspects(self, names: Sequence[str]) -> list[Suspect]:
        """Return both focal lengths together, and their ratio."""
        return [
            Suspect("focal", "camera focal length", np.array([0.01, 0.01]), "%"),
            Suspect("aspect", "camera aspect ratio", np.array([-0.005, 0.005]), "%"),
        ]

"""Pose of the camera of every frame."""

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.transforms import RigidTransform
from ...records.rig import Rig, Sharing
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, NaturalScales, PoseBlock, Value, register_block


@register_block
class CameraPose(PoseBlock):
    """world_from_camera; the world is where the gauge says."""

    name: ClassVar[str] = "camera_pose"
    words: ClassVar[str] = "camera pose"
    order: ClassVar[int] = 10

    def given(self, rig: Rig) -> RigidTransform:
        return RigidTransform.identity()

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        return replace(model, world_from_camera=value)

    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        # A camera's own motion is seen against the surface's distance.
        return np.repeat([1.0, scene.distance], 3)

    def sharing(self, rig: Rig) -> Sharing:
        # A frame that shares its surface with no other has nothing that its camera could move in.
        return "fixed" if rig.share.surface == "per_frame" else rig.share.camera_pose

"""Pose of the projector relative to the camera."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ...geometry.transforms import RigidTransform
from ...records.rig import Rig
from ...rendering.projector_coordinates import FrameModel
from .block import Floats, NaturalScales, PoseBlock, Value, register_block


@register_block
class ProjectorPose(PoseBlock):
    """projector_from_camera, baselines."""

    name: ClassVar[str] = "projector_pose"
    words: ClassVar[str] = "projector pose"
    order: ClassVar[int] = 20

    def given(self, rig: Rig) -> RigidTransform | None:
        """Return the pose with a translation of length one: lengths are in baselines."""
        if rig.projector.pose is None:
            return None
        pose = rig.projector.pose.to_transform()
        length = np.linalg.norm(pose.t)
        return RigidTransform(pose.R, pose.t / length if length > 0 else pose.t)

    def mean(self, values: Sequence[RigidTransform]) -> RigidTransform:
        """Return the mean pose with a translation of length one, as each then has."""
        units = [RigidTransform(p.R, p.t / np.linalg.norm(p.t)) for p in values]
        mean = super().mean(units)
        return RigidTransform(mean.R, mean.t / np.linalg.norm(mean.t))

    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        return replace(model, projector_from_camera=value)

    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        return np.ones(6)

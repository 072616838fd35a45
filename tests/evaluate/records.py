"""Exact solutions of the rig of ``conftest``, and changes to them."""

from types import SimpleNamespace
from typing import Any

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
)

NAMES = ["a.exr", "b.exr", "c.exr"]
CAMERA_POSES = [
    RigidTransform.identity(),
    RigidTransform.of([0.02, 0.05, 0.1], [3.0, -2, 4]),
    RigidTransform.of([-0.03, 0.02, 0.2], [-4.0, 1, 6]),
]


def record_of(world: SimpleNamespace, names: list[str] = NAMES, **changes: Any) -> Solution:
    """The exact solution of the world's rig, one frame for each name."""
    camera = world.camera
    fields: dict[str, Any] = {
        "outcome": Outcome.TRUTH, "units": "mm", "scale": "truth", "surface": "surface.ply",
        "camera": Camera.from_model(camera),
        "projector": ProjectorEstimate(
            law=world.projector.law, width=world.size[0], height=world.size[1],
            focal=Estimate(value=world.projector.focal, status="fixed"),
            centre=Estimate(value=list(world.projector.centre), status="fixed"),
            aspect=Estimate(value=world.projector.aspect, status="fixed"),
            distortion=Estimate(value=[0.03], status="fixed"),
        ),
        "frames": [
            Frame(
                name=name, projector_from_camera=PoseEstimate.of(world.pose),
                world_from_camera=PoseEstimate.of(pose),
            )
            for name, pose in zip(names, CAMERA_POSES, strict=False)
        ],
    }  # fmt: skip
    return Solution(**(fields | changes))


def with_frame(record: Solution, index: int, **changes: Any) -> Solution:
    frames = list(record.frames)
    frames[index] = frames[index].model_copy(update=changes)
    return record.model_copy(update={"frames": frames})


def with_focal(record: Solution, **fields: Any) -> Solution:
    projector = record.projector.model_copy(update={"focal": Estimate(**fields)})
    return record.model_copy(update={"projector": projector})

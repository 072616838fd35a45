"""A small result, capture and photograph for tests of commands that must not lose files."""

from pathlib import Path

import cv2
import numpy as np
import trimesh
import yaml

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import save_map
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
    save_solution,
)
from tests.cli.inputs import HEIGHT, WIDTH, q, rig

MARK = ".mitsuba-endo"


def write_result(folder: Path, name: str = "solution.json") -> Path:
    """Write a solution or truth with its surface, for a pinhole projector."""
    folder.mkdir(parents=True, exist_ok=True)
    pose = PoseEstimate.of(RigidTransform.of([0.1, -0.2, 0.05], [-6.0, 1.4, 0.5]))
    solution = Solution(
        outcome=Outcome.CONVERGED if name == "solution.json" else Outcome.TRUTH,
        units="mm", scale="baseline" if name == "solution.json" else "truth",
        camera=Camera.model_validate(rig()["camera"]), surface="surface.ply",
        projector=ProjectorEstimate(
            law="pinhole", width=240, height=120, focal=Estimate(value=321.0, status="measured"),
            centre=Estimate(value=[118.0, 61.0], status="fixed"),
        ),
        frames=[
            Frame(
                name="map.npz", projector_from_camera=pose,
                world_from_camera=PoseEstimate.of(RigidTransform.identity()),
            )
        ],
    )  # fmt: skip
    save_solution(folder / name, solution)
    box = trimesh.creation.box((30, 40, 5))
    box.apply_translation([0, 0, 60])
    box.export(folder / "surface.ply")
    return folder


def write_inputs(folder: Path) -> Path:
    """Write everything that a command may be given: rig, map, photograph, scene, stack."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig()), encoding="utf-8")
    save_map(folder / "map.exr", q())
    cv2.imwrite(str(folder / "photo.png"), np.full((HEIGHT, WIDTH), 90, np.uint8))
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder by its path in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }

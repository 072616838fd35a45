"""Truth as its own record, and the file that it leaves."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.endoscope import Endoscope
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.ground_truth import GroundTruth, TrueFrame, save_truth
from mitsuba_endo.records.known_input import known_rig
from mitsuba_endo.records.solution import Estimate, Outcome, Solution, load_solution

K = np.array([[142.0, 0, 99.5], [0, 141.0, 73.0], [0, 0, 1]])
CAMERA = CameraModel("opencv", 200, 150, K, (-0.1, 0.01))
PROJECTOR = projector_model("direction_cosine", 301.5, (190.0, 188.5), 1.01, [0.02])


def _truth() -> GroundTruth:
    poses = [RigidTransform.of([0.01 * k, 0.02, 0.1], [3.0, -4.0, 12.0 * k]) for k in range(2)]
    frames = [
        TrueFrame(f"{k}.exr", Endoscope(CAMERA, poses[0], PROJECTOR, pose))
        for k, pose in enumerate(poses)
    ]
    return GroundTruth(frames, (384, 380), "truth_surface.ply", {"seed": 3})


def test_the_file_is_read_by_what_reads_solutions(tmp_path: Path) -> None:
    """Oracle: the values that it was made of, exactly, each of them fixed."""
    truth = _truth()
    save_truth(tmp_path / "truth.json", truth)
    read = load_solution(tmp_path)
    assert (read.outcome, read.units, read.scale) == (Outcome.TRUTH, "mm", "truth")
    assert read.camera is not None
    np.testing.assert_array_equal(read.camera.to_model().K, K)
    assert read.projector.to_model() is not None
    assert read.projector.focal == Estimate(value=301.5, status="fixed")
    assert (read.projector.width, read.projector.height) == (384, 380)
    assert [f.name for f in read.frames] == ["0.exr", "1.exr"]
    for frame, true in zip(read.frames, truth.frames, strict=True):
        pose = frame.projector_from_camera.to_transform()
        assert pose is not None
        np.testing.assert_array_equal(pose.t, true.endoscope.projector_from_camera.t)
        np.testing.assert_array_equal(pose.R, true.endoscope.projector_from_camera.R)
    assert read.surface == "truth_surface.ply"
    assert read.configuration == {"seed": 3}


def test_the_file_has_every_key_of_the_schema(tmp_path: Path) -> None:
    """Oracle: the schema, by its names in files: readers of other tools find them all."""
    save_truth(tmp_path / "truth.json", _truth())
    keys = set(json.loads((tmp_path / "truth.json").read_text("utf-8")))
    assert keys == {field.alias or name for name, field in Solution.model_fields.items()}


def test_truth_holds_no_estimates() -> None:
    """Oracle: its fields; a deviation or a status would be none of a truth."""
    assert {f.name for f in fields(GroundTruth)} == {
        "frames", "pattern_size", "surface", "configuration",
    }  # fmt: skip


def test_a_rig_of_a_truth_keeps_what_is_to_be_found_to_itself() -> None:
    """Oracle: by hand; the baseline of t = (3, -4, 0) is 5, focal length and pose are not told."""
    rig = known_rig(_truth())
    assert rig.scale.baseline == 5.0
    assert rig.projector.focal.value is None
    assert rig.projector.pose is None

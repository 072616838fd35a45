"""``export`` from the command line."""

import json
from pathlib import Path

import cv2
import numpy as np
import trimesh

from mitsuba_endo.geometry.transforms import RigidTransform
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
from tests.cli.inputs import rig, run


def _result(folder: Path, focal: float | None) -> Path:
    estimate = Estimate(value=focal, status="measured" if focal else "unobservable")
    pose = PoseEstimate.of(RigidTransform.of([0.1, -0.2, 0.05], [-6.0, 1.4, 0.5]))
    world = PoseEstimate.of(RigidTransform.identity())
    solution = Solution(
        outcome=Outcome.CONVERGED, units="mm", scale="baseline",
        camera=Camera.model_validate(rig()["camera"]), surface="surface.ply",
        projector=ProjectorEstimate(
            law="pinhole", width=240, height=120, focal=estimate,
            centre=Estimate(value=[118.0, 61.0], status="fixed"),
        ),
        frames=[Frame(name="map.npz", projector_from_camera=pose, world_from_camera=world)],
    )  # fmt: skip
    save_solution(folder / "solution.json", solution)
    trimesh.creation.box((3, 4, 5)).export(folder / "surface.ply")
    return folder


def test_writes_the_file_and_says_so(tmp_path: Path):
    """Oracle: the matrix that cv2 reads is made of the solution's numbers."""
    out = tmp_path / "out.yml"
    result = run("export", _result(tmp_path, 321.0), "--format", "opencv", "--out", out, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout) == {"format": "opencv", "out": str(out)}
    storage = cv2.FileStorage(str(out), cv2.FILE_STORAGE_READ)
    expected = [[321, 0, 118], [0, 321, 61], [0, 0, 1]]
    np.testing.assert_array_equal(storage.getNode("projector_matrix").mat(), expected)
    storage.release()


def test_bad_input_is_one_sentence(tmp_path: Path):
    """Oracle: exit code 2 and a sentence that names the field, the format, the file."""
    folder, out = _result(tmp_path, None), tmp_path / "out.yml"
    for arguments, words in (
        ((folder, "--format", "opencv"), "projector.focal was not determined"),
        ((folder, "--format", "word"), "unknown format 'word'"),
        ((tmp_path / "absent", "--format", "ply"), "absent"),
    ):
        result = run("export", *arguments, "--out", out)
        assert result.exit_code == 2
        assert words in result.stderr
        assert result.stderr.count("\n") == 1
        assert not out.exists()

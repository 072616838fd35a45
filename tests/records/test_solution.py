"""Solution and truth files: one structure, null where nothing could be measured."""

import json
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import (
    Estimate,
    Frame,
    LeftOut,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
    load_solution,
    save_solution,
)

POSE = RigidTransform.of([0.1, -0.2, 0.05], [-6.0, 1.0, 0.5])


def _solution(focal: Estimate | None = None) -> Solution:
    return Solution(
        outcome=Outcome.CONVERGED, units="mm", scale="baseline",
        camera=Camera(width=4, height=3, K=[[5, 0, 1.5], [0, 6, 1], [0, 0, 1]]),
        projector=ProjectorEstimate(
            law="pinhole", width=64, height=48,
            focal=focal or Estimate(value=1884.1, std=0.4, status="measured"),
            centre=Estimate(value=[513.6, 860.7], status="fixed"),
            aspect=Estimate(value=1.01, status="fixed"),
            distortion=Estimate(value=[0.02, -0.01], status="fixed"),
        ),
        frames=[Frame(
            name="map.npz", projector_from_camera=PoseEstimate.of(POSE, std=[0.1] * 6),
            world_from_camera=PoseEstimate.of(RigidTransform.identity()), rms_px=0.31, used=57011,
        )],
        left_out=[LeftOut(name="bad.npz", reason="no overlap")],
        timings={"solve": 1.25}, configuration={"solver": "gauss-newton", "seed": 0},
    )  # fmt: skip


@pytest.mark.parametrize("name", ["solution.json", "truth.json"])
@pytest.mark.parametrize("by_folder", [True, False])
def test_round_trip(tmp_path: Path, name: str, by_folder: bool):
    """Oracle: the record itself, found by its file or by its folder."""
    save_solution(tmp_path / name, _solution())
    assert load_solution(tmp_path if by_folder else tmp_path / name) == _solution()


def test_file_has_the_documented_keys(tmp_path: Path):
    """Oracle: the example in the documentation of solution.json, read by plain json."""
    save_solution(tmp_path / "s.json", _solution())
    data = json.loads((tmp_path / "s.json").read_text())
    assert data["schema"] == 1
    assert (data["outcome"], data["units"], data["scale"]) == ("converged", "mm", "baseline")
    focal = data["projector"]["focal"]
    assert (focal["value"], focal["std"], focal["status"]) == (1884.1, 0.4, "measured")
    frame = data["frames"][0]
    np.testing.assert_allclose(frame["projector_from_camera"]["R"], POSE.R)
    assert frame["projector_from_camera"]["t"] == [-6.0, 1.0, 0.5]
    assert len(frame["projector_from_camera"]["std"]) == 6
    assert (frame["rms_px"], frame["used"]) == (0.31, 57011)
    assert {"timings", "versions", "configuration"} <= data.keys()


def test_models_and_poses_come_back(tmp_path: Path):
    """Oracle: the values the record was made from."""
    save_solution(tmp_path / "s.json", _solution())
    loaded = load_solution(tmp_path / "s.json")
    model = loaded.projector.to_model()
    assert model is not None
    assert (model.focal, model.centre, model.aspect) == (1884.1, (513.6, 860.7), 1.01)
    assert list(model.distortion.coefficients) == [0.02, -0.01]
    pose = loaded.frames[0].projector_from_camera.to_transform()
    assert pose is not None
    np.testing.assert_array_equal(pose.R, POSE.R)
    np.testing.assert_array_equal(pose.t, POSE.t)


def test_unobservable_is_null_with_reason(tmp_path: Path):
    """Oracle: JSON null, and no model can be built from it."""
    unknown = Estimate(value=None, status="unobservable", reason="the surface is a plane")
    save_solution(tmp_path / "s.json", _solution(unknown))
    data = json.loads((tmp_path / "s.json").read_text())["projector"]["focal"]
    assert data["value"] is None
    assert data["reason"] == "the surface is a plane"
    loaded = load_solution(tmp_path / "s.json")
    assert loaded.projector.focal.value is None
    assert loaded.projector.to_model() is None
    assert PoseEstimate(R=None, t=None, status="unobservable").to_transform() is None


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_nan_is_never_a_measured_value(bad: float):
    """Oracle: a value is finite or null; NaN is not valid JSON."""
    with pytest.raises(ValueError, match="finite"):
        Estimate(value=bad, status="measured")
    with pytest.raises(ValueError, match="finite"):
        Frame(
            name="a", projector_from_camera=PoseEstimate.of(POSE),
            world_from_camera=PoseEstimate.of(POSE), rms_px=bad,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("change", "field", "message"),
    [
        ({"outcome": "perhaps"}, "s.json: outcome", "'converged'"),
        ({"schema": 2}, "s.json: schema", "got 2"),
        ({"frames": []}, "s.json: frames", "at least 1 item"),
        ({"frame": []}, "s.json: frame", "did you mean 'frames'"),
        ({"projector": None}, "s.json: projector", "is not a mapping, got None"),
    ],
)
def test_bad_solution_file(tmp_path: Path, change: dict, field: str, message: str):
    """Oracle: the sentence names path and field."""
    data = json.loads(_solution().model_dump_json(by_alias=True)) | change
    (tmp_path / "s.json").write_text(json.dumps(data))
    with pytest.raises(InputError) as caught:
        load_solution(tmp_path / "s.json")
    assert caught.value.where == str(tmp_path / field)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"), [("{\n 'a'", r"not valid JSON \(line 2\)"), ("[]", "holds no JSON object")]
)
def test_bad_json(tmp_path: Path, text: str, message: str):
    """Oracle: the sentence names the file."""
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(InputError, match=message):
        load_solution(tmp_path / "s.json")


def test_empty_folder(tmp_path: Path):
    """Oracle: a sentence that names the file looked for."""
    with pytest.raises(InputError, match=r"solution\.json: no such file"):
        load_solution(tmp_path)


@pytest.mark.parametrize("key", ["[[[", "Float", "float", "list[int]"])
def test_unknown_keys_of_any_name_are_told(tmp_path: Path, key: str):
    """Oracle: the key itself. Some look like what pydantic adds to the path of an error."""
    data = {**json.loads(_solution().model_dump_json(by_alias=True)), key: 1}
    (tmp_path / "s.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="unknown key") as caught:
        load_solution(tmp_path / "s.json")
    assert str(caught.value.where).endswith(f"s.json: {key}")

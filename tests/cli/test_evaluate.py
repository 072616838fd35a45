"""``evaluate`` from the command line: several truths, tables, refusals."""

import json
import re
from pathlib import Path

import pytest

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

FOCAL, STD = 300.0, 0.4


def _solution(names: list[str], focal: float, outcome: Outcome) -> Solution:
    pose = PoseEstimate.of(RigidTransform.of([0.1, -0.2, 0.05], [-6.0, 1.4, 0.5]))
    world = PoseEstimate.of(RigidTransform.identity(), status="fixed")
    measured = outcome is not Outcome.TRUTH
    return Solution(
        outcome=outcome, units="mm", scale="baseline" if measured else "truth",
        camera=Camera.model_validate(rig()["camera"]),
        projector=ProjectorEstimate(
            law="pinhole", width=240, height=120,
            focal=Estimate(value=focal, std=STD if measured else None, status="measured"),
            centre=Estimate(value=[118.0, 61.0], status="fixed"),
        ),
        frames=[Frame(name=n, projector_from_camera=pose, world_from_camera=world) for n in names],
    )  # fmt: skip


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    for name in ("one", "two"):
        (tmp_path / "captures" / name).mkdir(parents=True)
        truth = _solution(["map"], FOCAL, Outcome.TRUTH)
        save_solution(tmp_path / "captures" / name / "truth.json", truth)
    return tmp_path / "captures"


def test_a_folder_of_captures_is_one_truth(captures: Path, tmp_path: Path):
    """Oracle: 0.6 px of focal length are 1.5 deviations, inside; tables and file say so."""
    save_solution(
        tmp_path / "solution.json",
        _solution(["two/map.exr", "one/map.exr"], FOCAL + 0.6, Outcome.CONVERGED),
    )
    out = tmp_path / "metrics.json"
    result = run("evaluate", tmp_path / "solution.json", "--truth", captures, "--out", out)
    assert result.exit_code == 0, result.stderr
    words = re.sub(r"[^\S\n]*│[^\S\n]*", "|", result.stdout)
    assert "focal length|0.6|0.78|+1.5|yes|px" in words
    assert "2 of 2 intervals (95 %) hold the truth." in words
    data = json.loads(out.read_text())
    assert [(f["name"], f["truth"]) for f in data["frames"]] == [
        ("two/map.exr", "two/map"), ("one/map.exr", "one/map"),
    ]  # fmt: skip
    focal = [v for v in data["values"] if v["quantity"] == "focal length"]
    assert [v["inside"] for v in focal if v["group"] != "camera"] == [True, True]


def test_truths_may_be_named_one_by_one(captures: Path, tmp_path: Path):
    """Oracle: --truth twice is the folder of both; names in other folders are refused."""
    save_solution(
        tmp_path / "solution.json", _solution(["one/map.exr", "two/map.exr"], 301, Outcome.STALLED)
    )
    truths = ["--truth", captures / "two", "--truth", captures / "one" / "truth.json"]
    out = tmp_path / "metrics.json"
    run_ = ("evaluate", tmp_path / "solution.json", *truths, "--out", out, "--json")
    result = run(*run_)
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["matched_by"] == "name"
    save_solution(
        tmp_path / "solution.json", _solution(["one/map.exr", "six/map.exr"], 301, Outcome.STALLED)
    )
    result = run(*run_)
    assert result.exit_code == 2
    assert (
        "frame six/map.exr: the truth has a frame of this name in another folder" in result.stderr
    )
    assert run(*run_, "--match", "order").exit_code == 0


@pytest.mark.parametrize("name", ["result", "result/solution.json", "link"])
def test_a_result_is_not_its_own_truth(tmp_path: Path, name: str):
    """Oracle: the sentence; all errors were zero, also where a truth lies beside."""
    (tmp_path / "result").mkdir()
    save_solution(tmp_path / "result" / "solution.json", _solution(["a"], 1.0, Outcome.CONVERGED))
    save_solution(tmp_path / "result" / "truth.json", _solution(["a"], FOCAL, Outcome.TRUTH))
    (tmp_path / "link").symlink_to(tmp_path / "result")
    out = tmp_path / "metrics.json"
    result = run("evaluate", tmp_path / "result", "--truth", tmp_path / name, "--out", out)
    assert result.exit_code == 2
    assert f"{tmp_path / name}: is the result itself (solution.json); give another" in result.stderr
    assert not out.exists()
    beside = tmp_path / "result" / "truth.json"
    result = run("evaluate", tmp_path / "result", "--truth", beside, "--out", out)
    assert result.exit_code == 0, result.stderr

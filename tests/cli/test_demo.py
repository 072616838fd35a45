"""The whole way, from a scene to a judged calibration, and what happens when it is cut short."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.cli.inputs import run


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder and the JSON summary of one demo."""
    out = tmp_path_factory.mktemp("demo") / "out"
    result = run("demo", "--out", out, "--json", "--quiet", "--debug")
    assert result.exit_code == 0, result.stderr
    assert result.stderr == ""
    return out, json.loads(result.stdout)


def test_demo_finds_the_truth(finished: tuple[Path, dict[str, Any]]):
    """Oracle: the rendered scene's own parameters.

    The decoder's errors cost 0.07 % in focal length, 0.5 degrees in direction and 0.24 mm on three
    seeds; the limits are three times that and more. The grid itself is narrower than the pattern,
    of which it leaves a tenth of what is seen without lines.
    """
    metrics = finished[1]["metrics"]
    assert metrics["focal_error_percent"] < 0.3
    assert metrics["rotation_error_deg"] < 0.1
    assert metrics["translation_direction_error_deg"] < 1.5
    assert metrics["shape_median_mm"] < 0.7
    assert metrics["coverage"] > 0.85


def test_demo_leaves_everything_it_names(finished: tuple[Path, dict[str, Any]]):
    """Oracle: the paths that the summary tells the user to look at."""
    out, _ = finished
    for name in (
        "capture/image.png", "capture/truth.json", "input/image.png", "decoded/image.exr",
        "decoded/image_graph.png", "input/rig.yaml",
        "solution/report.html", "solution/solution.json",
        "solution/surface.ply", "metrics.json",
    ):  # fmt: skip
        assert (out / name).stat().st_size > 100, name
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_report_shows_the_error(finished: tuple[Path, dict[str, Any]]):
    """Oracle: the name of that view of the surface; a calibration of the input alone has none
    (test_input_alone_gives_the_same_result), and gives the same numbers."""
    page = (finished[0] / "solution" / "report.html").read_text("utf-8")
    assert "error to truth" in page


def test_input_holds_no_answer(finished: tuple[Path, dict[str, Any]]):
    """Oracle: the list of unknowns; there are no coordinates."""
    out, _ = finished
    assert sorted(p.name for p in (out / "input").iterdir()) == ["image.png", "rig.yaml"]
    projector = yaml.safe_load((out / "input" / "rig.yaml").read_text())["projector"]
    assert projector["focal"] == {"refine": True}
    assert "pose" not in projector


def test_input_alone_gives_the_same_result(finished: tuple[Path, dict[str, Any]], tmp_path: Path):
    """Oracle: the demo's solution, found again in a new process where no truth is in reach."""
    shutil.copytree(finished[0] / "input", tmp_path / "input")
    arguments = ["input/image.png", "--rig", "input/rig.yaml", "--out", "again", "--json"]
    command = [sys.executable, "-m", "mitsuba_endo", "calibrate", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    again = json.loads(done.stdout)["solution"]
    assert again == json.loads((tmp_path / "again" / "solution.json").read_text())
    there = json.loads((finished[0] / "solution" / "solution.json").read_text())
    # Threads sum in any order, so the last digits may differ.
    assert again["projector"]["focal"]["value"] == pytest.approx(
        there["projector"]["focal"]["value"], rel=1e-5
    )
    assert "Projector pose" in done.stderr
    assert "error to truth" not in (tmp_path / "again" / "report.html").read_text("utf-8")


def test_evaluate_gives_the_same_metrics(finished: tuple[Path, dict[str, Any]], tmp_path: Path):
    """Oracle: the metrics that the demo wrote."""
    out, summary = finished
    result = run("evaluate", out / "solution", "--truth", out / "capture" / "truth.json",
                 "--out", tmp_path / "metrics.json", "--json")  # fmt: skip
    assert result.exit_code == 0, result.stderr
    written = json.loads((tmp_path / "metrics.json").read_text())
    assert json.loads(result.stdout) == written == summary["metrics"]


def test_ctrl_c_leaves_the_output_absent_or_complete(tmp_path: Path):
    """Oracle: the listing of the parent folder after SIGINT in the middle of the work."""
    command = [
        sys.executable,
        "-m",
        "mitsuba_endo",
        "demo",
        "--out",
        str(tmp_path / "out"),
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        deadline = time.monotonic() + 120
        # The rig file is the last thing written before the solver starts.
        while not list(tmp_path.glob(".out.*/input/rig.yaml")):
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        _, error = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130, error
    assert error.startswith("error: interrupted")
    assert "Traceback" not in error
    left = [p.name for p in tmp_path.iterdir()]
    assert left == [] or (left == ["out"] and (tmp_path / "out" / "metrics.json").exists())

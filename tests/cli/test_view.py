"""``view`` from the command line, as a process of its own."""

import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

import pytest

from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.show.solution_folder import write_solution_folder
from tests.cli.inputs import run
from tests.show.conftest import make_calibration
from tests.show.test_truth import write_truth

__all__ = ["make_calibration"]
pytest.importorskip("viser")
COMMAND = [sys.executable, "-m", "mitsuba_endo", "view"]


def test_prints_its_address_and_ends_with_ctrl_c(
    tmp_path: Path, make_calibration: Callable[..., Calibration]
):
    """Oracle: the page that is served there; SIGINT ends it with code 0 and not a word more."""
    write_solution_folder(tmp_path / "out", make_calibration(width=64, height=46))
    process = subprocess.Popen(
        [*COMMAND, str(tmp_path / "out"), "--no-browser", "--port", "18200"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        found = re.match(r"(http://localhost:\d+): the viewer; it ends with Ctrl-C\.", line)
        assert found is not None, line
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        with opener.open(found[1], timeout=20) as answer:
            assert b"<html" in answer.read(5000)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 0
    assert out == ""
    assert errors == ""


def test_bad_input_is_one_sentence(tmp_path: Path):
    """Oracle: exit code 2 and one line that names the folder; no server was started."""
    result = run("view", tmp_path / "absent", "--no-browser")
    assert result.exit_code == 2
    assert "absent" in result.stderr
    assert result.stderr.count("\n") == 1


# viser and the socket library under it; nothing of ours.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path: path.unlink(), "truth.json: no such file"),
        (lambda path: path.write_text("{"), "truth.json: is not valid JSON"),
        (lambda path: (path.parent / "truth.ply").unlink(), "truth.ply: no such file"),
    ],
)
def test_given_truth_that_cannot_be_read_is_refused(
    tmp_path: Path,
    make_calibration: Callable[..., Calibration],
    monkeypatch: pytest.MonkeyPatch,
    spoil: Callable[[Path], object],
    said: str,
):
    """Oracle: what the test took away, as `report` says it. Without the wait for Ctrl-C, at which
    it would stay if it went on."""
    monkeypatch.setattr("mitsuba_endo.show.viewer.wait_for_interrupt", lambda: None)
    calibration = make_calibration(width=64, height=46)
    write_solution_folder(tmp_path / "out", calibration)
    path = write_truth(tmp_path / "elsewhere", calibration)
    command = ("view", tmp_path / "out", "--no-browser", "--port", "18250", "--truth", path)
    assert run(*command).exit_code == 0
    spoil(path)
    result = run(*command)
    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1

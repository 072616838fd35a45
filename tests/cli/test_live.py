"""``calibrate --live`` from the command line, as a process of its own."""

import contextlib
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from mitsuba_endo.records.correspondence import save_map
from mitsuba_endo.records.known_input import save_rig
from mitsuba_endo.records.solution import load_solution
from scripts.benchmarks.chromium import EXECUTABLE, browser
from tests.cli.inputs import PROGRESS
from tests.rigs import with_noise
from tests.solve.problems import NOISE, rig_file, small_rig

pytest.importorskip("viser")
FIRST_PORT = 8080


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a map and its rig file."""
    folder = tmp_path_factory.mktemp("capture")
    rig = with_noise(small_rig("direction_cosine"), NOISE, 3)
    save_map(folder / "map.exr", rig.q)
    save_rig(folder / "rig.yaml", rig_file(rig))
    return folder


@contextlib.contextmanager
def _live(capture: Path, out: Path, stdin: int = subprocess.DEVNULL) -> Iterator[subprocess.Popen]:
    """Run the command; its browser is one that does nothing."""
    command = [sys.executable, "-m", "mitsuba_endo", "calibrate", "--live",
               str(capture / "map.exr"), "--rig", str(capture / "rig.yaml"),
               "--out", str(out)]  # fmt: skip
    process = subprocess.Popen(
        command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"BROWSER": "true"},
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _address(process: subprocess.Popen) -> str:
    assert process.stdout is not None
    line = process.stdout.readline()
    found = re.match(r"(http://localhost:\d+): the viewer; it ends with Ctrl-C\.", line)
    assert found is not None, line
    return found[1]


def _answers(address: str) -> bool:
    port = int(address.rpartition(":")[2])
    with contextlib.suppress(OSError):
        socket.create_connection(("localhost", port), timeout=2).close()
        return True
    return False


def test_ends_with_the_calibration(capture: Path, tmp_path: Path):
    """Oracle: exit code 0 and a solution, without a terminal to press Ctrl-C in; the first port is
    in use, so the next is told; nothing listens there afterwards. Who connects and leaves without
    a word is not worth an error."""
    with socket.socket() as taken, contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # in use by somebody else: as good
            taken.bind(("localhost", FIRST_PORT))
            taken.listen()
        process = stack.enter_context(_live(capture, tmp_path / "out"))
        address = _address(process)
        assert not address.endswith(f":{FIRST_PORT}")
        assert _answers(address)
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert PROGRESS.sub("", errors) == ""
    assert "Outcome: converged." in out
    assert load_solution(tmp_path / "out").outcome == "converged"
    assert not _answers(address)


def test_ctrl_c_ends_it(capture: Path, tmp_path: Path):
    """Oracle: exit code 130, one sentence, nothing left half written."""
    with _live(capture, tmp_path / "out") as process:
        address = _address(process)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    assert errors.count("\n") <= 1, errors
    left = list(tmp_path.iterdir())
    assert left == [] or (tmp_path / "out" / "solution.json").exists()
    assert not _answers(address)


@pytest.mark.skipif(EXECUTABLE is None, reason="no chromium installed")
def test_browser_sees_the_iterations(capture: Path, tmp_path: Path):
    """Oracle: chromium: iterations are told as they come, then the outcome; before a terminal the
    viewer stays until Ctrl-C, and the exit code is the calibration's."""
    terminal, end = pty.openpty()
    try:
        with _live(capture, tmp_path / "out", end) as process, browser(900, 600) as page:
            page.open(_address(process))
            page.wait_for("document.body.innerText.includes('iteration ')", 200)
            page.wait_for("document.body.innerText.includes('converged')", 200)
            text = page.evaluate("document.body.innerText")
            assert re.search(r"iteration \d+: cost [\d.]+ at scale [\d.]+ px, f = [\d.]+", text)
            assert process.poll() is None
            process.send_signal(signal.SIGINT)
            out, errors = process.communicate(timeout=60)
    finally:
        os.close(terminal)
        os.close(end)
    assert process.returncode == 0, errors
    assert "The viewer stays until Ctrl-C." in out
    assert PROGRESS.sub("", errors) == ""

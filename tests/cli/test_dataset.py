import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from tests.dataset.small import contents_of, make_here, small_config

COMMAND = [sys.executable, "-m", "mitsuba_endo", "dataset"]


def write_config(folder: Path, **changes) -> Path:
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(small_config(**changes).model_dump(mode="json")))
    return path


def run(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def count(out: Path) -> int:
    folder = out / "samples"
    if not folder.is_dir():
        return 0
    return sum(1 for path in folder.iterdir() if not path.name.startswith("."))


@pytest.mark.usefixtures("llvm")
def test_killed_and_started_again_it_ends_with_the_same_bytes(tmp_path: Path):
    """Oracle: the samples made by one process in one go.

    The first run is killed with SIGKILL, whose workers then end by themselves; the second makes
    the rest on two workers.
    """
    config, out = write_config(tmp_path), tmp_path / "out"
    make_here(small_config(), tmp_path / "whole", 14)
    first = subprocess.Popen(
        [*COMMAND, str(config), "--out", str(out), "--count", "14", "--workers", "1"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    deadline = time.monotonic() + 240
    while count(out) < 2 and time.monotonic() < deadline and first.poll() is None:
        time.sleep(0.005)
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    assert 2 <= count(out) < 14
    second = run(config, "--out", out, "--count", 14, "--workers", 2, "--json")
    assert second.returncode == 0, second.stderr
    assert json.loads(second.stdout) == {
        "folder": str(out), "done": 14, "failed": 0, "count": 14,
    }  # fmt: skip
    assert contents_of(out) == contents_of(tmp_path / "whole")
    assert (out / "contact_sheet_00.png").exists()


def test_a_disk_that_fills_ends_with_one_sentence(tmp_path: Path):
    """Oracle: a limit on the size of files that the system enforces, in the workers too.

    The limit lets small files through, so that the run begins, and stops the first EXR.
    """
    config, out = write_config(tmp_path), tmp_path / "out"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    done = run(config, "--out", out, "--count", 3, "--workers", 1, preexec_fn=limit)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "0 of 3 samples are kept; make room" in done.stderr
    assert count(out) == 0


def test_mistakes_are_told_before_anything_is_written(tmp_path: Path):
    """Oracle: exit code 2, one sentence, no folder."""
    (tmp_path / "bad.yaml").write_text("camera: {fovv: 60}")
    for arguments, told in (
        ((tmp_path / "bad.yaml",), "unknown key; did you mean 'fov'"),
        ((tmp_path / "none.yaml",), "no such file"),
        (("--dask", "tcp://a:1", "--workers", 2), "both given"),
    ):
        done = run(*arguments, "--out", tmp_path / "out", "--count", 1)
        assert done.returncode == 2
        assert told in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        assert not (tmp_path / "out").exists()


def test_the_example_can_be_printed():
    """Oracle: it is YAML, with the keys of a configuration."""
    done = run("--example")
    assert done.returncode == 0
    assert set(yaml.safe_load(done.stdout)) == set(small_config().model_dump())

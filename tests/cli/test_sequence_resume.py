"""``sequence --resume``: after Ctrl-C, after SIGKILL, with new frames, and what it refuses."""

import csv
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from mitsuba_endo.records.correspondence import write_map
from mitsuba_endo.records.solution import load_solution
from tests.cli.inputs import run
from tests.sequences import Recording, withdrawal

COUNT = 34
OFTEN = (
    "import mitsuba_endo.show.unfinished_folder as m; m.UnfinishedFolder.__init__.__defaults__ = "
    "(0.0,); m.SHARE = 0.0; from mitsuba_endo.cli.entry import main; main()"
)
"""The command line, with a state saved after every frame."""
SEEN = ["name", "lost", "camera_x", "camera_z", "camera_qw", "camera_std_z", "projector_x",
        "overlap"]  # fmt: skip


@pytest.fixture(scope="module")
def recording() -> Recording:
    return withdrawal(60)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, recording: Recording) -> Path:
    """Maps of a withdrawal, and what the command makes of them at one go."""
    folder = tmp_path_factory.mktemp("resume")
    (folder / "maps").mkdir()
    for k in range(COUNT):
        _write(folder, recording, k)
    rig = yaml.safe_dump(recording.rig().model_dump(mode="json"))
    (folder / "rig.yaml").write_text(rig, encoding="utf-8")
    done = run("sequence", folder / "maps", "--rig", folder / "rig.yaml", "--out",
               folder / "straight")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    return folder


def _write(folder: Path, recording: Recording, k: int) -> None:
    map_ = recording.map(k)
    write_map(folder / "maps" / f"{map_.name}.npz", map_)


def _rows(out: Path) -> list[list[str]]:
    with (out / "frames.csv").open(newline="") as file:
        return [[row[name] for name in SEEN] for row in csv.DictReader(file)]


def _near(rows: list[list[str]], others: list[list[str]], mm: float) -> bool:
    """Tell whether frames are the same, and their cameras no farther apart along x and z."""
    x, z = SEEN.index("camera_x"), SEEN.index("camera_z")
    return len(rows) == len(others) and all(
        a[:2] == b[:2] and all(abs(float(a[i]) - float(b[i])) < mm for i in (x, z))
        for a, b in zip(rows, others, strict=True)
    )


def _stop(folder: Path, out: str, after: str, number: signal.Signals) -> int:
    """Start the command, send it a signal once it says something, and return how it ended."""
    command = [sys.executable, "-c", OFTEN, "sequence", "maps", "--rig", "rig.yaml", "--out", out]
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith(after):
            process.send_signal(number)
            break
    process.communicate(timeout=120)
    return process.returncode


def _resume(folder: Path, out: str, resume: str, frames: str = "maps", rig: str = "rig.yaml"):
    return run("sequence", folder / frames, "--rig", folder / rig, "--out", folder / out,
               "--resume", folder / resume)  # fmt: skip


def test_killed_in_its_middle_it_goes_on(folder: Path) -> None:
    """Oracle: the folder that was made at one go. Until then a complete folder of what was
    finished lies beside, which nothing replaces unasked."""
    assert _stop(folder, "killed", "frame 28 of", signal.SIGKILL) == -signal.SIGKILL
    unfinished = folder / "killed.unfinished"
    assert not (folder / "killed").exists()
    count = len(_rows(unfinished))
    assert 26 <= count <= 29
    # As tracked: only at the end are all frames adjusted together, by up to two deviations.
    assert _near(_rows(unfinished), _rows(folder / "straight")[:count], 0.3)
    assert len((unfinished / "trajectory_camera.tum").read_text().splitlines()) == count
    again = run("sequence", folder / "maps", "--rig", folder / "rig.yaml", "--out",
                folder / "killed")  # fmt: skip
    assert again.exit_code == 2
    assert "killed.unfinished: holds what an unfinished run has found" in again.stderr
    assert f"--resume {folder / 'killed'}" in again.stderr
    done = _resume(folder, "killed", "killed")
    assert done.exit_code == 0, done.stderr
    assert done.stderr.splitlines()[0].startswith(f"frame {count + 1} of {COUNT} ")
    assert _rows(folder / "killed") == _rows(folder / "straight")
    same = [(folder / out / "mesh.ply").read_bytes() for out in ("killed", "straight")]
    assert same[0] == same[1]
    assert not unfinished.exists()


def test_ended_by_sigterm_it_leaves_a_result_and_goes_on(folder: Path) -> None:
    """Oracle: as above; the result is usable at once."""
    assert _stop(folder, "ended", "frame 24 of", signal.SIGTERM) == 130
    assert load_solution(folder / "ended").outcome == "interrupted"
    assert (folder / "ended" / "mesh.ply").is_file()
    assert not (folder / "ended.unfinished").exists()
    assert 24 <= len(_rows(folder / "ended")) < COUNT
    done = _resume(folder, "ended", "ended")
    assert done.exit_code == 0, done.stderr
    assert load_solution(folder / "ended").outcome == "converged"
    assert _rows(folder / "ended") == _rows(folder / "straight")


def test_new_frames_follow_those_of_a_finished_sequence(folder: Path, recording: Recording) -> None:
    """Oracle: the frames before stay where they were, and the new one is placed."""
    (folder / "more" / "maps").mkdir(parents=True)
    shutil.copytree(folder / "maps", folder / "more" / "maps", dirs_exist_ok=True)
    _write(folder / "more", recording, COUNT)
    done = _resume(folder, "longer", "straight", frames="more/maps")
    assert done.exit_code == 0, done.stderr
    rows = _rows(folder / "longer")
    # One frame more moves the others a little: all are adjusted together.
    assert _near(rows[:COUNT], _rows(folder / "straight"), 0.05)
    assert len(rows) == COUNT + 1
    assert rows[-1][1] == ""
    assert (folder / "straight" / "state.npz").is_file()  # what was resumed stays as it was


def test_what_does_not_belong_together_is_refused(folder: Path) -> None:
    data = yaml.safe_load((folder / "rig.yaml").read_text())
    data["scale"]["baseline"] *= 2
    (folder / "other.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    (folder / "few").mkdir()
    shutil.copy(folder / "maps" / "frame0000.npz", folder / "few")
    cases = {
        "the sequence to go on with was of another rig": ("straight", "maps", "other.yaml"),
        f"with has {COUNT} frames, and 1 are given": ("straight", "few", "rig.yaml"),
        "name the folder of an earlier sequence": ("maps", "maps", "rig.yaml"),
    }
    for words, (resume, frames, rig) in cases.items():
        done = _resume(folder, "refused", resume, frames, rig)
        assert done.exit_code == 2, done.stderr
        assert words in done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert not (folder / "refused").exists()

"""Readers of what a sequence leaves, and of trajectories."""

from pathlib import Path

from . import mutations
from .reader import Reader, cli, made


def _state(folder: Path) -> None:
    """Go on with a sequence as its command does, until the next frame would be placed."""
    from mitsuba_endo.records.rig import read_rig
    from mitsuba_endo.sequence.inputs import frames_of
    from mitsuba_endo.sequence.options import SequenceOptions
    from mitsuba_endo.sequence.resume import load_state

    rig, _ = read_rig(folder / "rig.yaml")
    past = load_state(folder)
    list(frames_of([folder / "maps"], rig, past=past))
    past.go_on(rig, SequenceOptions()).end()


def _report(folder: Path) -> None:
    cli("report", folder, "--out", folder.parent / "new.html")


def _evaluate(folder: Path) -> None:
    truth = folder / "keyframes" / "solution.json"
    cli("evaluate", folder, "--truth", truth, "--out", folder.parent / "new.json")


def _frames(folder: Path) -> None:
    from mitsuba_endo.show.read_sequence import read_sequence_folder

    read_sequence_folder(folder)


def _way(folder: Path) -> None:
    """Read a trajectory as ``render --trajectory`` does, before anything is rendered."""
    from mitsuba_endo.records.trajectory import load_tum

    for _, pose in load_tum(folder / "trajectory_camera.tum"):
        pose.inverse().matrix()


SEQUENCE_READERS = (
    Reader("sequence state", made("sequence"), "state.npz", _state, mutations.OF_ARRAYS, 2),
    Reader("sequence frames", made("sequence"), "frames.csv", _frames, mutations.OF_TEXT),
    Reader("sequence evaluate", made("sequence"), "frames.csv", _evaluate, mutations.OF_TEXT, 0.2),
    Reader("report of sequence", made("sequence"), "frames.csv", _report, mutations.OF_TEXT, 0.1),
    Reader("trajectory", made("sequence"), "trajectory_camera.tum", _way, mutations.OF_TEXT),
)

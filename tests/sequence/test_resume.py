"""A sequence that stops and goes on is the one that did not stop."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import write_map
from mitsuba_endo.records.object_file import save_objects
from mitsuba_endo.records.trajectory import FrameRow
from mitsuba_endo.sequence.frame_reading import FrameReading
from mitsuba_endo.sequence.inputs import Feed, frames_of
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.resume import Past, load_state, save_state
from mitsuba_endo.sequence.run import Recorded, Run, run_sequence
from tests.sequence.conftest import frames
from tests.sequences import Recording

FEW = SequenceOptions(first=5)


class Saves:
    """Saves the state after some frames, in place of a program that is killed there."""

    def __init__(self, folder: Path, after: int) -> None:
        self.folder, self.after = folder, after

    def after_frame(self, run: Run) -> None:
        if run.taken == self.after:
            names = [f"frame{k:04d} x" for k in range(run.taken)]
            save_state(self.folder / "state.npz", run, names, FrameReading())

    def at_end(self, run: Run) -> None:
        pass


def _values(row: FrameRow) -> list[object]:
    poses = [row.world_from_camera, row.projector_from_camera]
    numbers = [None if p is None else p.matrix().tolist() for p in poses]
    std = [None if s is None else s.tolist() for s in (row.camera_std, row.projector_std)]
    return [row.number, row.name, row.lost, row.part, row.keyframe, *numbers, *std, row.overlap]


@pytest.mark.parametrize("after", [3, 23])
def test_a_resumed_run_equals_one_that_did_not_stop(
    after: int, colon: Recording, recorded: Recorded, tmp_path: Path
) -> None:
    """Oracle: the run that did not stop, to the last bit: rows and map. Once it stops before the
    first frames are calibrated, once after the first of two frames of nothing."""
    run_sequence(list(frames(colon))[:after], colon.rig(), keeper=Saves(tmp_path, after))
    past, told = load_state(tmp_path), []
    run = past.go_on(colon.rig(), SequenceOptions(), told.append)
    found = run_sequence(list(frames(colon))[after:], colon.rig(), run=run)
    assert [_values(row) for row in found.rows] == [_values(row) for row in recorded.rows]
    assert [row.number for row in told] == list(range(0 if after == 3 else after, len(found.rows)))
    (a,), (b,) = found.parts, recorded.parts
    slots = np.arange(len(b.volume.index))
    assert np.array_equal(a.volume.index.places, b.volume.index.places)
    assert np.array_equal(a.volume.distance(slots), b.volume.distance(slots), equal_nan=True)
    assert found.told == recorded.told
    assert [k for k, _ in found.kept[0].kept] == [k for k, _ in recorded.kept[0].kept]


def test_an_interrupt_in_a_frame_waits_for_its_end(
    colon: Recording, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A signal in the middle of the fourth of seven placements: its frame is whole, and the state
    of that moment leads to the same end."""
    import signal

    from mitsuba_endo.sequence.part import Part

    straight = run_sequence([colon.map(k) for k in range(12)], colon.rig(), FEW)
    track, calls = Part.track, []

    def interrupted(self: Part, *arguments: object) -> object:
        calls.append(1)
        if len(calls) == 7:
            signal.raise_signal(signal.SIGINT)
        return track(self, *arguments)  # type: ignore[arg-type]

    class AtEnd(Saves):
        def at_end(self, run: Run) -> None:
            self.after = run.taken
            self.after_frame(run)

    monkeypatch.setattr(Part, "track", interrupted)
    stopped = run_sequence([colon.map(k) for k in range(12)], colon.rig(), FEW,
                           keeper=AtEnd(tmp_path, -1))  # fmt: skip
    assert stopped.interrupted
    count = len(stopped.rows)
    assert count == 8
    run = load_state(tmp_path).go_on(colon.rig(), FEW)
    found = run_sequence([colon.map(k) for k in range(count, 12)], colon.rig(), run=run)
    assert not found.interrupted
    assert [_values(row) for row in found.rows] == [_values(row) for row in straight.rows]


@pytest.fixture(scope="module")
def past(colon: Recording, tmp_path_factory: pytest.TempPathFactory) -> Past:
    folder = tmp_path_factory.mktemp("past")
    run_sequence([colon.map(k) for k in range(6)], colon.rig(), FEW, keeper=Saves(folder, 6))
    return load_state(folder)


def test_another_rig_or_option_is_refused(past: Past, colon: Recording) -> None:
    with pytest.raises(InputError, match="the sequence to go on with was of another rig"):
        past.go_on(colon.rig(drift=None), FEW)
    with pytest.raises(InputError, match=r"was with voxel None, not 0\.4; give None again"):
        past.go_on(colon.rig(), replace(FEW, voxel=0.4))
    with pytest.raises(InputError, match="was with pattern None, not pattern:coded"):
        past.check_reading(FrameReading("pattern:coded"))
    past.go_on(colon.rig(), replace(FEW, vertices=500))  # concerns the end alone


@pytest.fixture
def maps(colon: Recording, tmp_path: Path) -> list[Path]:
    paths = [tmp_path / f"frame{k:04d}.npz" for k in range(5)]
    for k, path in enumerate(paths):
        write_map(path, colon.map(k))
    return paths


def _feed(colon: Recording, maps: list[Path], past: Past | None = None) -> Feed:
    return frames_of(maps, colon.rig(), past=past)


def test_frames_seen_before_are_passed_over(colon: Recording, maps: list[Path], past: Past) -> None:
    first = _feed(colon, maps[:3])
    list(first)
    seen = replace(past, marks=list(first.marks))
    feed = _feed(colon, maps, seen)
    assert [frame.name for frame in feed] == ["frame0003.npz", "frame0004.npz"]
    assert feed.count == 5
    assert feed.marks[:3] == first.marks
    assert len(feed.marks) == 5
    assert list(_feed(colon, maps[:3], seen)) == []


def test_other_frames_are_refused(colon: Recording, maps: list[Path], past: Past) -> None:
    first = _feed(colon, maps[:3])
    list(first)
    seen = replace(past, marks=list(first.marks))
    with pytest.raises(InputError, match="with has 3 frames, and 2 are given"):
        list(_feed(colon, maps[:2], seen))
    with pytest.raises(InputError, match=r"frame 1 of the .* was frame0000\.npz there"):
        list(_feed(colon, maps[1:], seen))
    write_map(maps[1], colon.map(9))
    with pytest.raises(InputError, match=r"frame0001\.npz: frame 2 of .* has changed since"):
        list(_feed(colon, maps, seen))


def test_a_folder_without_a_state_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="name the folder of an earlier sequence"):
        load_state(tmp_path / "nothing")
    (tmp_path / "state.npz").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="is not a readable state of a sequence"):
        load_state(tmp_path)
    np.savez(tmp_path / "state.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="'tree' is missing"):
        load_state(tmp_path)


@pytest.mark.parametrize(
    "change",
    [{"state": None}, {"state": {}}, {"marks": [3]}, {"reading": {"refine": True}}, {"marks": ()}],
)
def test_objects_that_are_no_state_are_refused(
    past: Past, tmp_path: Path, change: dict[str, object]
) -> None:
    """They are read as objects of this version are, and lack what a sequence goes on from."""
    whole = {"state": past.state, "marks": past.marks, "reading": past.reading}
    save_objects(tmp_path / "state.npz", whole)
    assert load_state(tmp_path).marks == past.marks
    save_objects(tmp_path / "state.npz", whole | change)
    with pytest.raises(InputError, match="is not a readable state of a sequence"):
        load_state(tmp_path)

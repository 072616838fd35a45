"""Ends, gaps and bad input."""

from collections.abc import Iterator

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.sequence import run as module
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.outcome import outcome_of
from mitsuba_endo.sequence.run import Run, run_sequence
from tests.sequence.conftest import COUNT
from tests.sequences import Recording, withdrawal

FEW = SequenceOptions(first=4)


@pytest.fixture(autouse=True)
def _started(llvm: str) -> None:
    assert llvm


def _nothing(name: str) -> CorrespondenceMap:
    return CorrespondenceMap(np.full((120, 160, 2), np.nan, np.float32), name)


def test_interrupt_leaves_what_was_placed(colon: Recording) -> None:
    def frames() -> Iterator[Incoming]:
        yield from (colon.map(k) for k in range(7))
        raise KeyboardInterrupt

    found = run_sequence(frames(), colon.rig(), FEW)
    assert found.interrupted
    assert [row.number for row in found.rows] == list(range(7))
    result = outcome_of(found)
    assert result.solution.outcome == "interrupted"
    assert result.surfaces[0] is not None


def test_interrupt_before_anything_is_known_is_passed_on(colon: Recording) -> None:
    def frames() -> Iterator[Incoming]:
        yield colon.map(0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sequence(frames(), colon.rig(), FEW)


def test_frames_of_nothing_at_the_beginning(colon: Recording) -> None:
    """The first frame that shows enough is the world."""
    given = [_nothing("dark"), Unread("torn", "is damaged"), *(colon.map(k) for k in range(5))]
    rows = run_sequence(given, colon.rig(), FEW).rows
    assert [row.lost for row in rows[:2]] == ["it has 0 usable correspondences", "is damaged"]
    assert not any(row.lost for row in rows[2:])
    assert rows[2].world_from_camera is not None
    assert np.allclose(rows[2].world_from_camera.matrix(), np.eye(4))


def test_a_jump_begins_a_new_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the scene: within the part, motions are as they were, in mm."""
    monkeypatch.setattr(module, "LONG_LOSS", 2)
    long = withdrawal(160)
    numbers = [0, 1, 2, 3, 4, 150, 151, 152, 153, 154, 155]
    found = run_sequence(long.maps(numbers), long.rig(), FEW)
    assert [row.part for row in found.rows if not row.lost] == [0] * 5 + [1] * 4
    assert [row.number for row in found.rows if row.lost] == [5, 6]
    last, first = found.rows[-1].world_from_camera, found.rows[7].world_from_camera
    assert last is not None
    assert first is not None
    motion = first.inverse() @ last
    true = long.world_from_camera[152].inverse() @ long.world_from_camera[155]
    assert np.linalg.norm(motion.t - true.t) < 0.3
    result = outcome_of(found)
    assert "2 parts that do not overlap" in result.solution.verdict[1]
    assert len(result.surfaces) == 2
    assert result.main == 0


def test_parts_that_meet_again_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Away and back: the third part saw what the first one did, the second one did not.

    Oracle: the scene: poses of the third part in the first one's world.
    """
    monkeypatch.setattr(module, "LONG_LOSS", 1)
    long = withdrawal(160)
    numbers = [0, 1, 2, 3, 4, *range(150, 156), *range(2, 8)]
    maps = [CorrespondenceMap(long.map(k).q, f"f{i}") for i, k in enumerate(numbers)]
    found = run_sequence(maps, long.rig(), FEW)
    assert len(found.parts) == 3
    result = outcome_of(found)
    assert len(result.surfaces) == 2
    rows = [row for row in result.rows if not row.lost]
    assert [row.part for row in rows] == [0] * 5 + [1] * 5 + [0] * 5
    assert "2 parts" in result.solution.verdict[1]
    for row in rows[10:]:
        assert row.world_from_camera is not None
        off = row.world_from_camera.t - long.world_from_camera[numbers[row.number]].t
        assert np.linalg.norm(off) < 0.4


def test_a_lost_frame_is_found_again_by_keyframes(colon: Recording) -> None:
    """The last frame looks again where the first did: motion does not lead there."""
    numbers = [*range(COUNT), 1]
    maps = [CorrespondenceMap(colon.map(k).q, f"f{i}") for i, k in enumerate(numbers)]
    row = run_sequence(maps, colon.rig()).rows[-1]
    assert row.world_from_camera is not None
    assert np.linalg.norm(row.world_from_camera.t - colon.world_from_camera[1].t) < 0.4


def test_only_the_scale_changes_without_a_baseline(colon: Recording) -> None:
    """Oracle: with it, in mm: lengths are multiples of the first baseline."""
    maps = [colon.map(k) for k in range(6)]
    options = SequenceOptions(first=4)
    known = run_sequence(maps, colon.rig(drift=None), options)
    free = run_sequence(maps, colon.rig(drift=None, scale={}), options)
    assert outcome_of(free).units == "baseline"
    baseline = np.linalg.norm(colon.projector_from_camera[0].t)
    for a, b in zip(known.rows, free.rows, strict=True):
        assert a.world_from_camera is not None
        assert b.world_from_camera is not None
        assert a.world_from_camera.t == pytest.approx(baseline * b.world_from_camera.t, abs=1e-3)


def test_a_projector_that_all_frames_share_stays(colon: Recording) -> None:
    rig = colon.rig(drift=None, share={"projector_pose": "shared"})
    rows = run_sequence([colon.map(k) for k in range(4)], rig, FEW).rows
    poses = [row.projector_from_camera for row in rows if row.projector_from_camera is not None]
    assert len(poses) == 4
    for pose in poses[1:]:
        assert pose.t == pytest.approx(poses[0].t, abs=1e-4)


def test_frames_in_another_order_are_lost_or_where_they_were(colon: Recording) -> None:
    """Oracle: the scene. The first frame begins the map; the others come from all over the way."""
    numbers = [0, 9, 2, 16, 5, 12, 1, 20, 7, 14]
    rows = run_sequence([colon.map(k) for k in numbers], colon.rig(), FEW).rows
    placed = [(row, k) for row, k in zip(rows, numbers, strict=True) if not row.lost]
    assert len(placed) >= 8
    for row, k in placed:
        assert row.world_from_camera is not None
        assert np.linalg.norm(row.world_from_camera.t - colon.world_from_camera[k].t) < 0.6


BAD = {
    "no frames": ([], "there are no frames"),
    "one frame": ([0], "use the command calibrate"),
    "twice the same": ([0, 0], "two frames have this name"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_frames_are_refused(case: str, colon: Recording) -> None:
    numbers, words = BAD[case]
    with pytest.raises(InputError, match=words):
        run_sequence([colon.map(k) for k in numbers], colon.rig(), FEW)


def test_frames_without_a_pattern_are_refused(colon: Recording) -> None:
    with pytest.raises(InputError, match="no frame shows enough of the pattern"):
        run_sequence([_nothing("a"), _nothing("b")], colon.rig(), FEW)


def test_another_size_is_refused(colon: Recording) -> None:
    small = CorrespondenceMap(colon.map(1).q[::2, ::2], "half")
    with pytest.raises(InputError, match="frame half: is 80 x 60 pixels"):
        run_sequence([colon.map(0), small], colon.rig(), FEW)


PLANS = {
    "share.camera_pose": {"share": {"camera_pose": "fixed"}},
    "share.surface": {"share": {"surface": "per_frame"}},
    "share.focal": {"share": {"focal": "per_frame"}},
    "share.camera_focal": {"share": {"camera_focal": "shared"}},
    "drift": {"scale": {}},
}


@pytest.mark.parametrize("where", PLANS)
def test_a_rig_that_does_not_suit_is_refused_before_any_work(where: str, colon: Recording) -> None:
    with pytest.raises(InputError, match=where):
        Run(colon.rig(**PLANS[where]), FEW)

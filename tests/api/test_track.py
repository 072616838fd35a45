"""``me.track``: what it takes, what it gives, and that it equals the command's steps."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import mitsuba_endo as me
from mitsuba_endo.png import write_png
from mitsuba_endo.records.correspondence import CorrespondenceMap, save_map
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.sequence.options import SequenceOptions
from tests.sequences import Recording, exact, withdrawal

FEW = SequenceOptions(first=4)
COUNT = 7


@pytest.fixture(scope="module")
def clean() -> Recording:
    return withdrawal(COUNT, noise=exact)


@pytest.fixture(scope="module")
def result(clean: Recording) -> me.TrackedSequence:
    """Maps as arrays, one at a time; the fifth shows nothing."""

    def arrays() -> Iterator[np.ndarray]:
        for k in range(COUNT):
            yield clean.map(k).q * (np.nan if k == 4 else 1)

    return me.track(arrays(), clean.rig(), options=FEW)


def test_arrays_give_poses_and_a_surface(result: me.TrackedSequence, clean: Recording) -> None:
    """Oracle: the scene; maps are exact, and what is left is the voxels'."""
    assert [frame.name for frame in result.frames] == [f"frame_{k}" for k in range(COUNT)]
    assert [frame.number for frame in result.lost] == [4]
    last = result.frames[-1].world_from_camera
    assert last is not None
    assert np.linalg.norm(last.t - clean.world_from_camera[-1].t) < 0.05
    assert result.unit == "mm"
    assert f"{COUNT - 1} of {COUNT} frames were placed" in result.verdict
    assert result.surface is not None
    assert result.keyframes is not None
    assert "7 frames, 1 lost" in repr(result)


def test_depth_of_a_frame_is_the_scenes(result: me.TrackedSequence, clean: Recording) -> None:
    """Oracle: exact points of the last frame; folds' edges are the voxels' alone."""
    depth, true = result.depth(-1), clean.exact(COUNT - 1)[1][..., 2]
    both = np.isfinite(depth) & np.isfinite(true)
    assert both.mean() > 0.8
    assert np.median(np.abs(depth - true)[both]) < 0.1
    for frame, words in ((4, "frame frame_4 was lost"), (COUNT, "there is no frame 7")):
        with pytest.raises(me.InputError, match=words):
            result.depth(frame)


def test_a_saved_sequence_is_gone_on_with(
    result: me.TrackedSequence, clean: Recording, tmp_path: Path
) -> None:
    """Oracle: the frames before stay where they were, but for what one more frame adjusts."""
    result.save(tmp_path / "out")
    assert load_solution(tmp_path / "out").outcome == "converged"
    arrays = [clean.map(k).q * (np.nan if k == 4 else 1) for k in range(COUNT)]
    seen: list[str] = []
    again = me.track(
        [*arrays, clean.map(5).q], clean.rig(), options=FEW, resume=tmp_path / "out",
        on_frame=lambda frame: seen.append(frame.name),
    )  # fmt: skip
    assert seen == ["frame_7"]
    for a, b in zip(result.frames, again.frames[:COUNT], strict=True):
        assert (a.lost, a.number) == (b.lost, b.number)
        if a.world_from_camera is not None and b.world_from_camera is not None:
            assert np.linalg.norm(a.world_from_camera.t - b.world_from_camera.t) < 0.01
    with pytest.raises(me.InputError, match="has changed since"):
        me.track(arrays[1:], clean.rig(), options=FEW, resume=tmp_path / "out")


def test_files_and_records_are_taken(clean: Recording, tmp_path: Path) -> None:
    """Oracle: the same poses from a folder of maps as from records of the same names."""
    for k in range(3):
        save_map(tmp_path / f"frame{k}.exr", clean.map(k).q)
    records = [CorrespondenceMap(clean.map(k).q, f"frame{k}.exr") for k in range(3)]
    a, b = (me.track(given, clean.rig(), options=FEW) for given in (tmp_path, records))
    for x, y in zip(a.frames, b.frames, strict=True):
        assert x.name == y.name
        assert x.world_from_camera is not None
        assert y.world_from_camera is not None
        assert np.allclose(x.world_from_camera.t, y.world_from_camera.t, atol=1e-9)


def test_arrays_of_another_tool_under_a_mask(clean: Recording, tmp_path: Path) -> None:
    """Oracle: the poses from the same arrays as they are counted here, without the tool's
    pixels."""
    mask = np.full(clean.map(0).valid.shape, 255, np.uint8)
    mask[80:, 120:] = 0
    write_png(tmp_path / "tool.png", mask)
    arrays = [clean.map(k).q for k in range(3)]
    hidden = [np.where(mask[..., None] > 0, q, np.float32(np.nan)) for q in arrays]
    theirs = me.track(
        [q + 1 for q in arrays], clean.rig(), options=FEW, map_convention="one-based",
        mask=tmp_path / "tool.png",
    )  # fmt: skip
    ours = me.track(hidden, clean.rig(), options=FEW)
    for x, y in zip(theirs.frames, ours.frames, strict=True):
        assert x.world_from_camera is not None
        assert y.world_from_camera is not None
        np.testing.assert_allclose(x.world_from_camera.t, y.world_from_camera.t, atol=2e-3)


def test_what_cannot_be_used_is_refused(clean: Recording, tmp_path: Path) -> None:
    q = clean.map(0).q
    cases = [
        (([q, str(tmp_path)], {}), "is a path among maps"),
        (([q, q], {"refine": False}), "is for files of images"),
        (([q, q[::2]], {}), "frame frame_1: is 160 x 60 pixels"),
        (([q[..., 0]], {}), "give a map"),
        (([], {}), "there are no frames"),
        (([q], {}), "one frame is no sequence"),
    ]
    for (captures, options), words in cases:
        with pytest.raises(me.InputError, match=words):
            me.track(captures, clean.rig(), **options)

"""Frames from files: maps of other tools and masks, read as ``calibrate`` reads them."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap, save_map
from mitsuba_endo.sequence.frame_reading import FrameReading
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.inputs import frames_of
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.outcome import outcome_of
from mitsuba_endo.sequence.run import run_sequence
from tests.sequences import Recording

FEW = SequenceOptions(first=4)
COUNT = 5
TOOL = 40
"""Column from which a tool covers the image."""


def _read(colon: Recording, folder: Path, reading: FrameReading) -> list[Incoming]:
    return list(frames_of([folder], colon.rig(), reading=reading))


def _same(found: Sequence[Incoming], colon: Recording, most: float = 1e-4) -> None:
    """Compare frames with the recording's maps."""
    for k, frame in enumerate(found):
        assert isinstance(frame, CorrespondenceMap)
        np.testing.assert_allclose(frame.q, colon.map(k).q, atol=most)


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".exr"])
def test_folders_of_maps_of_each_kind(colon: Recording, tmp_path: Path, suffix: str) -> None:
    """Oracle: the maps written; a picture that lies beside them is none."""
    for k in range(2):
        q, path = colon.map(k).q, tmp_path / f"frame{k}{suffix}"
        if suffix == ".npy":
            np.save(path, q)
        else:
            save_map(path, q)
    cv2.imwrite(str(tmp_path / "frame0_graph.png"), np.zeros((4, 4), np.uint8))
    found = _read(colon, tmp_path, FrameReading())
    assert [frame.name for frame in found] == [f"frame{k}{suffix}" for k in range(2)]
    _same(found, colon)


def test_maps_that_count_otherwise(colon: Recording, tmp_path: Path) -> None:
    """Oracle: the maps before they were turned into another tool's; without its words they are
    other maps."""
    height = colon.rig().projector.height
    for k in range(2):
        x, y = np.moveaxis(colon.map(k).q, -1, 0)
        turned = np.stack([height - 1 - y + 1, x + 1], axis=-1)
        turned[~np.isfinite(turned)] = -7
        np.save(tmp_path / f"frame{k}.npy", turned.astype(np.float32))
    words = "one-based,swapped,y-upwards,missing=-7"
    _same(_read(colon, tmp_path, FrameReading(map_convention=words)), colon)
    with pytest.raises(AssertionError):
        _same(_read(colon, tmp_path, FrameReading()), colon)


def test_maps_in_other_units_are_refused_with_the_words_to_state(
    colon: Recording, tmp_path: Path
) -> None:
    size = np.array([colon.rig().projector.width, colon.rig().projector.height])
    for k in range(2):
        np.save(tmp_path / f"frame{k}.npy", ((colon.map(k).q + 0.5) / size).astype(np.float32))
    feed = frames_of([tmp_path], colon.rig())
    with pytest.raises(InputError, match=r"lie between 0 and 1\).*--map-convention normalised"):
        run_sequence(feed, colon.rig(), FEW)
    _same(_read(colon, tmp_path, FrameReading(map_convention="normalised")), colon, 1e-3)


def _mask(path: Path, shape: tuple[int, ...], column: int) -> None:
    mask = np.full(shape, 255, np.uint8)
    mask[:, column:] = 0
    cv2.imwrite(str(path), mask)


def test_a_mask_for_all_frames_or_one_for_each(colon: Recording, tmp_path: Path) -> None:
    """Oracle: the pixels drawn black. A frame without a tool has a white mask; one without a mask,
    and one that is black all over, are lost and say so."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "masks").mkdir()
    shape = colon.map(0).valid.shape
    for k in range(4):
        np.save(tmp_path / "maps" / f"frame{k}.npy", colon.map(k).q)
    _mask(tmp_path / "all.png", shape, TOOL)
    for k, column in ((0, TOOL), (1, shape[1]), (3, 0)):
        _mask(tmp_path / "masks" / f"frame{k}.png", shape, column)
    for frame in _read(colon, tmp_path / "maps", FrameReading(mask=str(tmp_path / "all.png"))):
        assert isinstance(frame, CorrespondenceMap)
        assert not frame.valid[:, TOOL:].any()
        assert frame.valid[:, :TOOL].any()
    found = _read(colon, tmp_path / "maps", FrameReading(mask=str(tmp_path / "masks")))
    first, second, without, black = found
    assert isinstance(first, CorrespondenceMap)
    assert not first.valid[:, TOOL:].any()
    _same([second], _Only(colon, 1))  # type: ignore[arg-type]
    assert isinstance(without, Unread)
    assert without.reason.endswith("masks holds no mask of frame frame2.npy")
    assert isinstance(black, Unread)
    assert black.reason.endswith("frame3.png leaves out no pixel or all")


class _Only:
    """A recording that begins with another frame."""

    def __init__(self, recording: Recording, first: int) -> None:
        self._recording, self._first = recording, first

    def map(self, k: int) -> CorrespondenceMap:
        return self._recording.map(self._first + k)


@pytest.mark.parametrize(
    ("kind", "reading", "words"),
    [
        ("maps", {"pattern": "pattern:coded"}, "--pattern: is for images"),
        ("maps", {"refine": False}, "--no-refine: is for images"),
        ("maps", {"map_convention": "two-based"}, "unknown 'two-based'"),
        ("maps", {"mask": "small.png"}, "the mask is 8 x 8 pixels and the frame 160 x 120"),
        ("maps", {"mask": "none.png"}, "no such image"),
        ("images", {"map_convention": "one-based"}, "--map-convention: is for maps"),
    ],
)
def test_what_does_not_suit_is_refused_before_any_frame(
    colon: Recording, tmp_path: Path, kind: str, reading: dict[str, object], words: str
) -> None:
    (tmp_path / "maps").mkdir()
    (tmp_path / "images").mkdir()
    np.save(tmp_path / "maps" / "a.npy", colon.map(0).q)
    cv2.imwrite(str(tmp_path / "images" / "a.png"), np.zeros((120, 160), np.uint8))
    _mask(tmp_path / "small.png", (8, 8), 4)
    if "mask" in reading:
        reading = {"mask": str(tmp_path / str(reading["mask"]))}
    with pytest.raises(InputError, match=words):
        frames_of([tmp_path / kind], colon.rig(), reading=FrameReading(**reading))  # type: ignore[arg-type]


def test_numbers_that_stand_for_missing_are_left_out_and_told(colon: Recording) -> None:
    """Oracle: the same frames with NaN, to the last bit."""

    def frames(missing: float) -> list[CorrespondenceMap]:
        maps = [colon.map(k) for k in range(COUNT)]
        q = [np.where(m.valid[..., None], m.q, np.float32(missing)) for m in maps]
        return [CorrespondenceMap(a, m.name) for a, m in zip(q, maps, strict=True)]

    right, found = (run_sequence(frames(m), colon.rig(), FEW) for m in (np.nan, -1.0))
    for a, b in zip(right.rows, found.rows, strict=True):
        assert a.world_from_camera is not None
        assert b.world_from_camera is not None
        np.testing.assert_array_equal(a.world_from_camera.matrix(), b.world_from_camera.matrix())
    assert not right.findings
    (said,) = outcome_of(found).solution.warnings
    assert said.startswith("frame0000: map: ")
    assert "hold (-1, -1), which looks like a sign for missing and is left out" in said

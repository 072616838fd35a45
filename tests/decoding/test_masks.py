"""Masks of the pixels to use."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.decoding.masks import Masks
from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap

SHAPE = (14, 24)


def map_(name: str = "a.exr") -> CorrespondenceMap:
    return CorrespondenceMap(np.ones((*SHAPE, 2), np.float32), name)


def tool(column: int) -> np.ndarray:
    """White but for a tool at the right."""
    mask = np.full(SHAPE, 255, np.uint8)
    mask[5:, column:] = 0
    return mask


def test_one_for_all(tmp_path: Path):
    """Oracle: the pixels drawn black, whatever the image's depth and colours."""
    for k, image in enumerate((tool(9), tool(9) // 255, np.dstack([tool(9)] * 3))):
        path = tmp_path / f"{k}.png"
        cv2.imwrite(str(path), image)
        for name in ("a.exr", "b.exr"):
            left = Masks.at(path).applied(map_(name)).valid
            np.testing.assert_array_equal(left, tool(9) > 0)


def test_one_for_each_frame(tmp_path: Path):
    """Oracle: the mask of each frame's name; files of one name go by their folders."""
    (tmp_path / "left").mkdir()
    for name, column in (("a", 5), ("b_mask", 7), ("left/a", 11)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), tool(column))
    masks = Masks.at(tmp_path)
    for frame, column in (("a.exr", 5), ("b.npz", 7), ("left/a.exr", 11)):
        np.testing.assert_array_equal(masks.applied(map_(frame)).valid, tool(column) > 0)
    for frame in ("c.exr", "right/a.exr"):
        with pytest.raises(InputError, match=f"holds no mask of frame {frame}"):
            masks.of(frame)


def test_a_frame_without_a_tool_has_a_white_mask(tmp_path: Path):
    """Oracle: no pixel of it is left out; one that is black all over leaves none."""
    cv2.imwrite(str(tmp_path / "a.png"), np.full(SHAPE, 255, np.uint8))
    cv2.imwrite(str(tmp_path / "b.png"), np.zeros(SHAPE, np.uint8))
    masks = Masks.at(tmp_path)
    assert masks.applied(map_("a.exr")).valid.all()
    with pytest.raises(InputError, match=r"b\.png: leaves out no pixel or all"):
        masks.of("b.exr")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (tool(9)[:-1], "the mask is 24 x 13 pixels and the frame 24 x 14"),
        (np.full(SHAPE, 255, np.uint8), "leaves out no pixel or all"),
        (np.random.default_rng(0).integers(0, 256, SHAPE, np.uint8), "many gray pixels"),
    ],
)
def test_what_is_no_mask_is_refused(tmp_path: Path, image: np.ndarray, message: str):
    """Oracle: the sentence."""
    cv2.imwrite(str(tmp_path / "m.png"), image)
    with pytest.raises(InputError, match=message):
        Masks.at(tmp_path / "m.png").applied(map_())

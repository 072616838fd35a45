import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.dataset.contact_sheet import (
    caption,
    grid_lines,
    photograph,
    truth_picture,
    write_contact_sheets,
)
from mitsuba_endo.dataset.contents import Stored
from mitsuba_endo.dataset.reader import Dataset
from tests.dataset.small import make_here, small_config


@pytest.mark.usefixtures("llvm")
def test_every_sample_is_on_a_sheet_beside_its_truth(tmp_path: Path):
    """Oracle: each thumbnail's pixels, searched for in the sheet."""
    make_here(small_config(), tmp_path / "out", 5)
    dataset = Dataset(tmp_path / "out")
    (path,) = write_contact_sheets(dataset)
    sheet = cv2.imread(str(path))[..., ::-1]
    for sample in (dataset[i] for i in range(5)):
        pair = [photograph(sample), truth_picture(sample)]
        both = np.hstack([pair[0], np.full((len(pair[0]), 2, 3), 255, np.uint8), pair[1]])
        found = cv2.matchTemplate(np.ascontiguousarray(sheet), both, cv2.TM_SQDIFF)
        # Grey levels squared; the search sums in single precision.
        assert found.min() / both.size < 0.1


def test_lines_lie_where_the_phase_is_zero():
    """Oracle: phase of vertical lines at x = 3.2, 13.2, ... and horizontal ones at y = 5.6, ..."""
    y, x = np.mgrid[:24, :40]
    lattice = np.stack([(x - 3.2) / 10, (y - 5.6) / 12], -1)
    phase = 2 * np.pi * (np.mod(lattice + 0.5, 1) - 0.5)
    lines = grid_lines(phase)
    expected = np.zeros((24, 40), bool)
    expected[:, [3, 13, 23, 33]] = True
    expected[[6, 18], :] = True
    assert np.array_equal(lines, expected)


def test_a_caption_tells_number_kind_and_polyps():
    """Oracle: the text."""
    told = {"index": 7, "kind": "colon", "polyps": [{"diameter": 4.26}, {"diameter": 9.0}]}
    assert caption(Stored(told, {})) == "7  colon, polyps 4.3, 9.0 mm"


def test_sheets_are_the_same_to_the_bit_wherever_the_dataset_lies(tmp_path: Path):
    """Oracle: the bytes of a copy under another name, drawn again."""
    make_here(small_config(), tmp_path / "one", 2)
    shutil.copytree(tmp_path / "one", tmp_path / "other")
    sheets = [write_contact_sheets(Dataset(tmp_path / name)) for name in ("one", "other")]
    first, second = ([path.read_bytes() for path in paths] for paths in sheets)
    assert first == second

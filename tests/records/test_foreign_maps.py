"""Files of maps that other tools write: parts, layers, names, forms of arrays."""

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.map_arrays import find_pair
from mitsuba_endo.records.map_convention import read_map_convention
from tests.cli.inputs import q

X, Y = (np.ascontiguousarray(q()[..., i]) for i in (0, 1))
BEAUTY = {"R": X / 1000, "G": Y / 1000, "B": X / 2000}


def _exr(path: Path, *parts: dict[str, np.ndarray], **header: object) -> Path:
    """Write an OpenEXR file with one part for each dictionary of channels."""
    made = [
        OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION,
                      "name": f"part{k}", **header}, dict(part))
        for k, part in enumerate(parts)
    ]  # fmt: skip
    OpenEXR.File(made).write(str(path))
    return path


@pytest.mark.parametrize(
    "parts",
    [
        [BEAUTY, {"projector.x": X, "projector.y": Y}],
        [{"projector.x": X, "projector.y": Y}, BEAUTY],
        [{"projector.x": X}, {"projector.y": Y}],
        [{**BEAUTY, "ViewLayer.projector.X": X, "ViewLayer.projector.Y": Y}],
        [{**BEAUTY, "projector_x": X, "projector_y": Y}],
        [{"map.x": X, "map.y": Y, "normal.X": Y, "normal.Y": X, "normal.Z": X}],
        [{"u": X, "v": Y}],
    ],
    ids=lambda parts: "|".join(",".join(part) for part in parts),
)
def test_parts_layers_and_names(tmp_path: Path, parts: list[dict[str, np.ndarray]]):
    """Oracle: the arrays written."""
    np.testing.assert_array_equal(load_map(_exr(tmp_path / "m.exr", *parts)).q, q())


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ([BEAUTY], "channel projector.x is missing among 'B, G, R'"),
        ([{"x": X, "y": Y, "z": X}], "channel projector.x is missing"),
        ([{"x": X, "y": Y, "u": X, "v": Y}], "several pairs may be projector x and y: u/v, x/y"),
        ([{"projector.x": X, "projector.y": Y}] * 2, "several pairs .*: part0.projector.x"),
    ],
)
def test_what_cannot_be_told_is_refused(tmp_path: Path, parts: list, message: str):
    """Oracle: the sentence, which names the channels."""
    with pytest.raises(InputError, match=message):
        load_map(_exr(tmp_path / "m.exr", *parts))


def test_channels_that_are_stated(tmp_path: Path):
    """Oracle: the arrays written; a channel that is not there is named."""
    path = _exr(tmp_path / "m.exr", {"R": X, "G": Y})
    np.testing.assert_array_equal(load_map(path, read_map_convention("channels=R/G")).q, q())
    with pytest.raises(InputError, match="channel A is missing"):
        load_map(path, read_map_convention("channels=R/A"))
    np.savez(tmp_path / "m.npz", across=X, down=Y, other=X)
    stated = read_map_convention("channels=across/down")
    np.testing.assert_array_equal(load_map(tmp_path / "m.npz", stated).q, q())
    np.savez(tmp_path / "n.npz", across=X, down=Y[:-1])
    with pytest.raises(InputError, match="differ in size"):
        load_map(tmp_path / "n.npz", stated)
    np.save(tmp_path / "m.npy", q())
    with pytest.raises(InputError, match="has no names"):
        load_map(tmp_path / "m.npy", stated)


def test_half_precision_is_read(tmp_path: Path):
    """Oracle: NumPy's own rounding."""
    half = {"projector.x": X.astype(np.float16), "projector.y": Y.astype(np.float16)}
    np.testing.assert_array_equal(load_map(_exr(tmp_path / "m.exr", half)).q, np.float16(q()))


def test_borders_that_a_writer_cut_off(tmp_path: Path):
    """Oracle: the window by hand: the file holds rows 2 to 15 and columns 3 to 26 of 18 x 30."""
    window = (np.array([3, 2], np.int32), np.array([26, 15], np.int32))
    shown = (np.array([0, 0], np.int32), np.array([29, 17], np.int32))
    path = _exr(tmp_path / "m.exr", {"projector.x": X, "projector.y": Y}, dataWindow=window,
                displayWindow=shown)  # fmt: skip
    read = load_map(path).q
    assert read.shape == (18, 30, 2)
    np.testing.assert_array_equal(read[2:16, 3:27], q())
    assert np.isfinite(read[..., 0]).sum() == X.size
    window = (np.array([-2, -1], np.int32), np.array([21, 12], np.int32))
    shown = (np.array([0, 0], np.int32), np.array([9, 7], np.int32))
    path = _exr(tmp_path / "n.exr", {"projector.x": X, "projector.y": Y}, dataWindow=window,
                displayWindow=shown)  # fmt: skip
    np.testing.assert_array_equal(read_exr(path)["projector.x"], X[1:9, 2:12])


def test_lossy_compression_is_refused(tmp_path: Path):
    """Oracle: OpenEXR's own codes; a picture's channels may still be read."""
    header = {"compression": OpenEXR.DWAA_COMPRESSION}
    path = _exr(tmp_path / "m.exr", {"projector.x": X, "projector.y": Y}, **header)
    with pytest.raises(InputError, match="compressed with loss"):
        load_map(path)
    assert read_exr(path)["projector.x"].shape == X.shape


@pytest.mark.parametrize(
    "arrays",
    [
        {"correspondence": q()},
        {"q": np.moveaxis(q(), -1, 0)},
        {"map_x": X, "map_y": Y},
        {"col": X, "row": Y, "mask": np.ones(5)},
        {"map": q().astype(np.float16), "weight": np.ones(X.shape)},
        {"map": q().astype(">f8")},
        {"map": q().astype(np.uint16)},
    ],
    ids=lambda arrays: ",".join(arrays),
)
def test_arrays_of_other_names_and_forms(tmp_path: Path, arrays: dict[str, np.ndarray]):
    """Oracle: the coordinates, which are whole numbers below 2048, written."""
    np.savez(tmp_path / "m.npz", **arrays)
    np.testing.assert_array_equal(load_map(tmp_path / "m.npz").q, q())


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.stack([q(), q()]), "the array is float32 2x14x24x2"),
        (np.dstack([q(), X]), "the array is float32 14x24x3"),
        (q().reshape(-1, 2), "the array is float32 336x2"),
        (q().astype(np.uint8), "too small for pattern pixels"),
        (np.array([{}]), "is not a readable npy file"),
    ],
)
def test_arrays_that_are_no_map(tmp_path: Path, array: np.ndarray, message: str):
    """Oracle: the sentence, which says what it is."""
    np.save(tmp_path / "m.npy", array)
    with pytest.raises(InputError, match=message):
        load_map(tmp_path / "m.npy")


def test_a_pair_is_of_one_layer():
    """Oracle: by hand: x of one layer and y of another are no pair."""
    with pytest.raises(InputError, match="is missing"):
        find_pair(["left.x", "right.y"], "m.exr")
    assert find_pair(["left.x", "left.y", "right.z"], "m.exr") == ("left.x", "left.y")

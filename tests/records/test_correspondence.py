"""Correspondence maps: round trips and the sentences for bad files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import (
    CorrespondenceMap,
    load_map,
    relative_weight,
    save_map,
    write_map,
)
from mitsuba_endo.records.exr_files import read_exr, write_exr

HEIGHT, WIDTH = 5, 9


def _q() -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    q = np.stack([100 + 3.25 * x, 40 - 7.5 * y], -1).astype(np.float32)
    q[1, 3] = np.nan
    return q


@pytest.mark.parametrize("name", ["map.exr", "map.npz", "MAP.NPZ", "MAP.EXR"])
def test_round_trip(tmp_path: Path, name: str):
    """Oracle: the array itself; float32 is kept to the last bit, NaN stays NaN."""
    save_map(tmp_path / name, _q())
    loaded = load_map(tmp_path / name)
    assert loaded.name == name
    assert loaded.q.dtype == np.float32
    np.testing.assert_array_equal(loaded.q, _q())
    assert loaded.valid.sum() == HEIGHT * WIDTH - 1
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_exr_channels_are_named_and_not_swapped(tmp_path: Path):
    """Oracle: OpenEXR's own reader."""
    save_map(tmp_path / "m.exr", _q())
    with OpenEXR.File(str(tmp_path / "m.exr"), separate_channels=True) as file:
        channels = {k: c.pixels for k, c in file.channels().items()}
    assert set(channels) == {"projector.x", "projector.y"}
    assert channels["projector.x"].shape == (HEIGHT, WIDTH)
    np.testing.assert_array_equal(channels["projector.y"], _q()[..., 1])


@pytest.mark.parametrize("name", ["m.exr", "m.npz"])
def test_weights_are_read_and_none_is_known_without_one(tmp_path: Path, name: str):
    """Oracle: the weights written; a coordinate of weight zero or NaN is missing."""
    q = _q()
    weight = np.linspace(0.1, 1, q[..., 0].size, dtype=np.float32).reshape(q.shape[:2])
    weight[1, 2], weight[3, 4] = 0, np.nan
    save_map(tmp_path / name, q, {"weight": weight})
    map_ = load_map(tmp_path / name)
    assert map_.weight is not None
    np.testing.assert_array_equal(map_.weight, weight)
    assert not map_.valid[1, 2]
    assert not map_.valid[3, 4]
    expected = np.isfinite(q).all(-1) & (weight > 0)
    np.testing.assert_array_equal(map_.valid, expected)


def test_missing_if_either_coordinate_is(tmp_path: Path):
    """Oracle: a correspondence is a pair, infinity is as missing as NaN."""
    q = _q()
    q[0, 0, 0] = np.nan
    q[2, 2, 1] = np.inf
    np.savez(tmp_path / "m.npz", map=q.astype(np.float64))
    loaded = load_map(tmp_path / "m.npz")
    assert np.isnan(loaded.q[[0, 2], [0, 2]]).all()
    assert loaded.valid.sum() == HEIGHT * WIDTH - 3


def test_other_channels_are_ignored(tmp_path: Path):
    """Oracle: the two channels' own values."""
    q = _q()
    extra = np.ones((HEIGHT, WIDTH))
    write_exr(tmp_path / "m.exr", {"R": extra, "projector.x": q[..., 0], "projector.y": q[..., 1]})
    np.testing.assert_array_equal(load_map(tmp_path / "m.exr").q, q)
    assert set(read_exr(tmp_path / "m.exr")) == {"R", "projector.x", "projector.y"}


def _npz(path: Path, **arrays: np.ndarray) -> Path:
    np.savez(path, **arrays)
    return path


def _truncated(path: Path) -> Path:
    save_map(path, _q())
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    return path


def _damaged_npz(path: Path) -> Path:
    save_map(path, _q())
    data = path.read_bytes()
    path.write_bytes(data[:60] + b"xxxx" + data[64:])
    return path


def _array_named_npz(path: Path) -> Path:
    with path.open("wb") as file:
        np.save(file, _q())
    return path


def _text(path: Path) -> Path:
    path.write_text("not an image")
    return path


def _endless() -> np.ndarray:
    weight = np.full((5, 9), 0.5)
    weight[2, 3] = np.inf
    return weight


def _one_channel(path: Path) -> Path:
    write_exr(path, {"projector.x": _q()[..., 0]})
    return path


@pytest.mark.parametrize(
    ("make", "name", "message"),
    [
        (lambda p: p, "none.npz", "no such file; check the path"),
        (_text, "m.png", "unknown kind of map '.png'; give an .exr, .npz or .npy"),
        (_truncated, "m.npz", "is not a readable npz file"),
        (_damaged_npz, "m.npz", "is not a readable npz file"),
        (_array_named_npz, "m.npz", "is an array, not an npz file"),
        (_text, "m.npz", "is not a readable npz file"),
        (
            lambda p: _npz(p, q=_q(), r=_q()),
            "m.npz",
            "array 'map' is missing among 'q, r'",
        ),
        (lambda p: _npz(p, map=_q()[..., 0]), "m.npz", "array 'map' is float32 5x9"),
        (lambda p: _npz(p, map=_q() + 1j), "m.npz", "array 'map' is complex64 5x9x2"),
        (_truncated, "m.exr", "is not a readable OpenEXR file"),
        (_text, "m.exr", "is not a readable OpenEXR file"),
        (_one_channel, "m.exr", "channel projector.y is missing"),
        (lambda p: _npz(p, map=_q(), weight=_q()), "m.npz", "weight has shape (5, 9, 2)"),
        (lambda p: _npz(p, map=_q(), weight=4 * np.ones((5, 9))), "m.npz", "from 4 to 4; divide"),
        (lambda p: _npz(p, map=_q(), weight=_endless()), "m.npz", "from 0.5 to inf; divide"),
        (lambda p: _npz(p, map=_q() * np.nan), "m.npz", "the map has no finite value"),
        (
            lambda p: _npz(p, map=_q() / 1000 % 1),
            "m.npz",
            "state --map-convention normalised",
        ),
    ],
)
def test_bad_maps_end_with_a_sentence(tmp_path: Path, make, name: str, message: str):
    """Oracle: the sentence names the file, the fault and the remedy."""
    path = make(tmp_path / name)
    with pytest.raises(InputError) as caught:
        load_map(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize("name", ["m.png", "m"])
def test_saving_another_kind_is_refused(tmp_path: Path, name: str):
    """Oracle: no file."""
    with pytest.raises(InputError, match="unknown kind of map"):
        save_map(tmp_path / name, _q())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["m.exr", "m.npz"])
def test_saving_where_nothing_can_be_written(tmp_path: Path, name: str):
    """Oracle: a sentence; OpenEXR itself would raise a RuntimeError."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="cannot be written"):
        save_map(tmp_path / "file" / name, _q())


def _with_covariance() -> CorrespondenceMap:
    q = _q()
    covariance = np.full((HEIGHT, WIDTH, 3), np.nan, np.float32)
    known = np.isfinite(q[..., 0])
    rng = np.random.default_rng(0)
    covariance[known] = rng.uniform([0.01, -0.005, 0.02], [0.02, 0.005, 0.03], (known.sum(), 3))
    return CorrespondenceMap(q, "m", relative_weight(covariance), covariance, 8.5)


@pytest.mark.parametrize("name", ["m.exr", "m.npz"])
def test_covariances_make_a_round_trip(tmp_path: Path, name: str):
    """Oracle: the arrays written."""
    written = _with_covariance()
    write_map(tmp_path / name, written, {"confidence": np.ones((HEIGHT, WIDTH), np.float32)})
    read = load_map(tmp_path / name)
    assert read.covariance is not None
    assert read.weight is not None
    np.testing.assert_array_equal(read.covariance, written.covariance)
    np.testing.assert_array_equal(read.weight, written.weight)
    np.testing.assert_array_equal(read.q, written.q)
    assert read.correlation_px == 8.5


def test_channels_of_covariances(tmp_path: Path):
    """Oracle: the documented names, and OpenEXR's own reader."""
    map_ = _with_covariance()
    write_map(tmp_path / "m.exr", map_)
    channels = read_exr(tmp_path / "m.exr")
    assert map_.covariance is not None
    for i, name in enumerate(("covariance.xx", "covariance.xy", "covariance.yy")):
        np.testing.assert_array_equal(channels[name], map_.covariance[..., i])
    with OpenEXR.File(str(tmp_path / "m.exr")) as file:
        assert file.header()["correlation_px"] == 8.5


@pytest.mark.parametrize("name", ["m.exr", "m.npz"])
def test_covariances_give_weights_where_none_are_written(tmp_path: Path, name: str):
    """Oracle: 1 / mean variance, relative to the best; NaN covariances make pixels missing."""
    map_ = _with_covariance()
    assert map_.covariance is not None
    map_.covariance[2, 2] = np.nan
    write_map(tmp_path / name, replace(map_, weight=None, correlation_px=None))
    read = load_map(tmp_path / name)
    variance = (map_.covariance[..., 0] + map_.covariance[..., 2]) / 2
    expected = np.nan_to_num(np.nanmin(variance) / variance)
    assert read.weight is not None
    np.testing.assert_allclose(read.weight, expected, rtol=1e-6)
    assert not read.valid[2, 2]
    assert read.correlation_px is None


def test_bad_covariances_are_refused(tmp_path: Path):
    """Oracle: the sentences, which name the file."""
    map_ = _with_covariance()
    assert map_.covariance is not None
    wrong = map_.covariance.copy()
    wrong[0, 0] = [0.01, 0.2, 0.01]
    write_map(tmp_path / "a.npz", replace(map_, covariance=wrong, weight=None))
    with pytest.raises(InputError, match=r"a\.npz: holds a covariance that is not positive"):
        load_map(tmp_path / "a.npz")
    write_map(tmp_path / "b.npz", replace(map_, covariance=wrong[..., :2], weight=None))
    with pytest.raises(InputError, match=r"b\.npz: covariance has shape"):
        load_map(tmp_path / "b.npz")
    write_map(tmp_path / "c.exr", replace(map_, correlation_px=-1.0))
    with pytest.raises(InputError, match=r"c\.exr: correlation_px is -1"):
        load_map(tmp_path / "c.exr")
    channels = {"projector.x": _q()[..., 0], "projector.y": _q()[..., 1]}
    write_exr(tmp_path / "d.exr", channels | {"covariance.xx": _q()[..., 0]})
    with pytest.raises(InputError, match=r"d\.exr: channel covariance\.xy is missing"):
        load_map(tmp_path / "d.exr")

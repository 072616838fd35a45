"""Objects through a file: exact, shared where they were shared, and nothing that acts."""

from collections import deque
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.fusion import RangeFrame, Volume
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records import object_file
from mitsuba_endo.records.object_file import load_objects, save_objects
from mitsuba_endo.records.rig import Rig
from tests.sequences import withdrawal


def _through(tmp_path: Path, **roots: object) -> dict:
    save_objects(tmp_path / "a.npz", roots)
    return load_objects(tmp_path / "a.npz", "file of objects", "make it again")


def _camera() -> CameraModel:
    K = np.array([[60.0, 0, 29], [0, 55, 21], [0, 0, 1]])
    return CameraModel("opencv_fisheye", 60, 40, K, (0.02, -0.006, 0.001, -0.0005))


def test_values_come_back_as_they_were(tmp_path: Path) -> None:
    """Oracle: the values; floats to the last bit, NaN and infinity included."""
    given = {
        "none": None, "yes": True, "third": 1 / 3, "nan": float("nan"), "inf": -float("inf"),
        "text": "ä \n", "list": [1, (2.5, "x")], "set": {"b", "a"}, "keys": {(1, 2): [None]},
        "deque": deque([1, 2, 3], maxlen=3), "number": np.float64(0.1), "flag": np.bool_(True),
        "array": np.array([[1.5, np.nan]], np.float32), "empty": np.zeros((0, 3)),
    }  # fmt: skip
    found = _through(tmp_path, **given)
    assert found.keys() == given.keys()
    for name in given.keys() - {"nan", "array", "empty"}:
        assert found[name] == given[name], name
        assert type(found[name]) is type(given[name]), name
    assert np.isnan(found["nan"])
    assert found["deque"].maxlen == 3
    for name in ("array", "empty"):
        assert found[name].dtype == given[name].dtype
        assert np.array_equal(found[name], given[name], equal_nan=True)


def test_random_numbers_go_on(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    rng.random(5)
    again = _through(tmp_path, rng=rng)["rng"]
    assert np.array_equal(again.standard_normal(10), rng.standard_normal(10))


def test_objects_are_shared_as_before_and_keep_nothing_computed(tmp_path: Path) -> None:
    """Oracle: a camera that two frames hold, whose rays had been computed."""
    camera, rays = _camera(), np.full((40, 60), 30.0)
    frames = [RangeFrame(rays, camera, RigidTransform.identity()) for _ in range(2)]
    assert np.isfinite(frames[0].footprint)
    a, b = _through(tmp_path, frames=frames)["frames"]
    assert a.camera is b.camera
    assert a.range is b.range
    assert set(vars(a)) == {"range", "camera", "world_from_camera", "weight"}
    assert np.array_equal(a.camera.grid_rays, camera.grid_rays)


def test_a_volume_grows_as_if_it_had_stayed(tmp_path: Path) -> None:
    """Oracle: the volume that stayed, to the last bit."""
    ranges = 30 + np.random.default_rng(0).normal(0, 0.1, (40, 60))
    poses = [RigidTransform.of([0, 0, 0.05 * k], [0.1 * k, 0, 0]) for k in range(2)]
    first, second = (RangeFrame(ranges, _camera(), pose) for pose in poses)
    stayed = Volume(0.7)
    stayed.integrate(first)
    gone = _through(tmp_path, volume=stayed)["volume"]
    for volume in (stayed, gone):
        volume.integrate(second)
    slots = np.arange(len(stayed.index))
    assert np.array_equal(stayed.index.places, gone.index.places)
    assert np.array_equal(stayed.distance(slots), gone.distance(slots), equal_nan=True)
    assert np.array_equal(stayed.scatter(slots), gone.scatter(slots))


def test_records_are_checked_again(tmp_path: Path) -> None:
    rig = withdrawal(3).rig()
    found = _through(tmp_path, rig=rig)["rig"]
    assert isinstance(found, Rig)
    assert found == rig


def test_what_acts_is_not_saved(tmp_path: Path) -> None:
    for wrong in (print, Volume, Path("a"), withdrawal):
        with pytest.raises(TypeError, match="cannot be saved"):
            save_objects(tmp_path / "a.npz", {"wrong": wrong})
    assert not list(tmp_path.iterdir())


NAMES = [
    "os:system", "subprocess:Popen", "mitsuba_endo.__main__:app", "mitsuba_endo.nothing:A",
    "mitsuba_endo.fusion.tsdf:Nothing", "mitsuba_endo.fusion.tsdf:np", "mitsuba_endo.files:Path",
    None, 3, {"a": "b"},
]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_only_classes_of_the_package_are_made(
    name: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(object_file, "_name", lambda _cls: name)
    save_objects(tmp_path / "a.npz", {"volume": Volume(1.0)})
    with pytest.raises(InputError, match="is not a readable file of objects"):
        load_objects(tmp_path / "a.npz", "file of objects", "make it again")


def test_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A dataclass with other fields, and another number."""
    save_objects(tmp_path / "a.npz", {"pose": RigidTransform.identity()})
    with monkeypatch.context() as patch:
        patch.setattr(object_file, "FORMAT", 99)
        with pytest.raises(InputError, match="is not a readable"):
            load_objects(tmp_path / "a.npz", "file", "make it again")
    monkeypatch.setattr(
        object_file, "_content", lambda value: {"R": value.R} if hasattr(value, "R") else value
    )
    save_objects(tmp_path / "a.npz", {"pose": RigidTransform.identity()})
    with pytest.raises(InputError, match="is not a readable"):
        load_objects(tmp_path / "a.npz", "file", "make it again")

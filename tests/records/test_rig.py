"""The rig file: what it accepts, and one sentence with file and field for what it does not."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.rig import Camera, load_rig

K = [[400.0, 0.0, 210.5], [0.0, 395.0, 168.0], [0.0, 0.0, 1.0]]


def _data() -> dict[str, Any]:
    return {
        "units": "mm",
        "camera": {"model": "opencv", "width": 427, "height": 342, "K": K, "distortion": [-0.1]},
        "projector": {
            "law": "pinhole", "width": 1024, "height": 768, "focal": {"value": 1500},
            "centre": [513.6, 860.7], "aspect": 1.01, "distortion": [0.02, -0.01],
            "pose": {"R": [0.0, 0.1, 0.0], "t": [-600, 20, 5]},
        },
        "scale": {"baseline": 674.0},
    }  # fmt: skip


def _load(folder: Path, data: Any):
    path = folder / "rig.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data))
    return load_rig(path)


def _with(field: str, value: Any) -> dict[str, Any]:
    data = _data()
    *parents, last = field.split(".")
    part = data
    for name in parents:
        part = part[name]
    part[last] = value
    return data


def _without(field: str) -> dict[str, Any]:
    data = _data()
    *parents, last = field.split(".")
    part = data
    for name in parents:
        part = part[name]
    del part[last]
    return data


@pytest.mark.parametrize(
    ("model", "most", "accepted"),
    [("opencv", 9, [0, 1, 2, 3, 4, 5, 8]), ("opencv_fisheye", 5, [0, 1, 2, 3, 4])],
)
def test_numbers_of_coefficients(tmp_path: Path, model: str, most: int, accepted: list[int]):
    """Oracle: docs/rig.md; those left out are 0, by the rays of a list that is filled up."""
    pixels = np.array([[3.0, 300.0], [420.0, 17.0]])
    for count in range(most + 1):
        data = _with("camera.distortion", [0.01 * (k + 1) for k in range(count)])
        data["camera"]["model"] = model
        if count not in accepted:
            with pytest.raises(InputError, match=f"{count} distortion coefficients do not fit"):
                _load(tmp_path, data)
            continue
        rays = _load(tmp_path, data).camera.to_model().rays(pixels)
        data["camera"]["distortion"] += [0.0] * (accepted[-1] - count)
        filled = _load(tmp_path, data).camera.to_model().rays(pixels)
        np.testing.assert_allclose(rays, filled, atol=1e-12)


def test_full_file(tmp_path: Path):
    """Oracle: the values written into the file."""
    rig = _load(tmp_path, _data())
    camera = rig.camera.to_model()
    assert (camera.width, camera.height) == (427, 342)
    np.testing.assert_array_equal(camera.K, K)
    projector = rig.projector.to_model()
    assert projector.focal == 1500
    assert projector.centre == (513.6, 860.7)
    assert projector.aspect == 1.01
    assert rig.projector.focal.refine
    assert rig.projector.pose is not None
    pose = rig.projector.pose.to_transform()
    c, s = np.cos(0.1), np.sin(0.1)
    np.testing.assert_allclose(pose.R, [[c, 0, s], [0, 1, 0], [-s, 0, c]], atol=1e-15)
    assert rig.scale.kind == "baseline"


def test_defaults(tmp_path: Path):
    """Oracle: the defaults documented with the fields; the middle is (size - 1) / 2."""
    data = {"camera": {"width": 3, "height": 2, "K": K}, "projector": {"width": 64, "height": 48}}
    rig = _load(tmp_path, data)
    model = rig.projector.to_model()
    assert model.law == "direction_cosine"
    assert model.centre == (31.5, 23.5)
    assert model.focal == 64
    assert rig.projector.focal.refine
    assert rig.scale.kind == "up_to_scale"


@pytest.mark.parametrize("written", ["1500", "1500.0", "1.5e3", "15e2"])
def test_focal_as_a_number_is_known_and_fixed(tmp_path: Path, written: str):
    """Oracle: the documented meaning. YAML 1.1 takes 15e2, without a point, for text."""
    text = yaml.safe_dump(_without("projector.focal"))
    text = text.replace("projector:\n", f"projector:\n  focal: {written}\n")
    focal = _load(tmp_path, text).projector.focal
    assert focal.value == 1500
    assert not focal.refine


@pytest.mark.parametrize("scale", ["up_to_scale", {"up_to_scale": True}, None, {}])
def test_up_to_scale_spellings(tmp_path: Path, scale: Any):
    """Oracle: the documented meaning."""
    assert _load(tmp_path, _with("scale", scale)).scale.kind == "up_to_scale"


def test_known_distance(tmp_path: Path):
    """Oracle: the values written into the file."""
    known = {"pixels": [[10, 20], [300, 40]], "mm": 12.5}
    scale = _load(tmp_path, _with("scale", {"known_distance": known})).scale
    assert scale.kind == "known_distance"
    assert scale.known_distance is not None
    assert scale.known_distance.pixels == [[10, 20], [300, 40]]


TWO_K = [K[0], K[1]]
NAN_K = [[float("nan"), 0, 1], K[1], K[2]]
ZERO_K = [K[0], [0, 0, 100], K[2]]
SKEWED_K = [[400, 3, 200], K[1], K[2]]
MIRROR = [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("data", "field", "message"),
    [
        (_with("camera.K", NAN_K), "camera.K.0.0", "finite number, got nan"),
        (_with("camera.K", ZERO_K), "camera.K", "not positive; give fx and fy in pixels"),
        (_with("camera.K", SKEWED_K), "camera.K", "remove skew"),
        (_with("camera.K", TWO_K), "camera.K", "at least 3 items"),
        (_with("camera.K", 400), "camera.K", "valid list, got 400"),
        (_without("camera.K"), "camera.K", "is missing; add it"),
        (_with("camera.model", "fisheye"), "camera.model", "choose from opencv, double_sphere"),
        (_with("camera.width", 0), "camera.width", "greater than 0, got 0"),
        (_with("camera.height", 3.5), "camera.height", "got 3.5"),
        (_with("camera.distortion", [0.1] * 6), "camera", "6 distortion coefficients"),
        (_with("camera.distortion", [float("inf")]), "camera.distortion.0", "finite"),
        (_with("camera.distrotion", []), "camera.distrotion", "did you mean 'distortion'"),
        (_with("camera", 5), "camera", "is not a mapping, got 5; the keys are model, width"),
        (_without("camera"), "camera", "is missing"),
        (_with("projector.law", "pinhol"), "projector.law", "pinhole, direction_cosine, auto"),
        (_with("projector.focal", -3), "projector.focal.value", "greater than 0, got -3"),
        (_with("projector.focal", {"valeu": 3}), "projector.focal.valeu", "did you mean 'value'"),
        (_with("projector.focal", {"refine": False}), "projector.focal", "value is missing"),
        (_with("projector.focal", "long"), "projector.focal", "is not a mapping, got 'long'"),
        (_with("projector.centre", [1, 2, 3]), "projector.centre", "at most 2 items"),
        (_with("projector.aspect", 0), "projector.aspect", "equal to 0.01, got 0"),
        (_with("projector.distortion", [0.1] * 6), "projector.distortion", "at most 5 items"),
        (_with("projector.pose.R", MIRROR), "projector.pose.R", "not a rotation matrix"),
        (_with("projector.pose.R", [1, 2]), "projector.pose.R", "neither 3x3 nor three"),
        (_with("projector.pose.R", [[1], [2, 3]]), "projector.pose.R", "neither 3x3 nor three"),
        (_with("projector.pose.t", [1, 2]), "projector.pose.t", "at least 3 items"),
        (_without("projector.width"), "projector.width", "is missing"),
        (_with("scale.baseline", 0), "scale.baseline", "greater than 0"),
        (_with("scale", 674), "scale", "is not a mapping, got 674; the keys are baseline"),
        (_with("scale.basline", 674), "scale.basline", "did you mean 'baseline'"),
        (_with("scale", {"baseline_std": 1}), "scale", "add baseline"),
        (
            _with("scale.known_distance", {"pixels": [[1, 2], [3, 4]], "mm": 2}),
            "scale", "keep one",
        ),
        (_with("share", {"focal": "both"}), "share.focal", "'fixed', 'shared' or 'per_frame'"),
        (_with("share", {"focla": "fixed"}), "share.focla", "did you mean 'focal'"),
        (_with("drift", {"roll": 1}), "drift.roll", "did you mean 'roll_deg'"),
        (_with("units", "m"), "units", "input should be 'mm', got 'm'"),
        (_with("unit", "mm"), "unit", "did you mean 'units'"),
    ],
)  # fmt: skip
def test_bad_field(tmp_path: Path, data: dict[str, Any], field: str, message: str):
    """Oracle: the sentence names path and field exactly, and says what to do."""
    with pytest.raises(InputError) as caught:
        _load(tmp_path, data)
    assert caught.value.where == f"{tmp_path / 'rig.yaml'}: {field}"
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.todo


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1\nb: 2\n", "is not valid YAML in line 2"),
        ("- a\n- b\n", "holds no mapping"),
        ("", "holds no mapping"),
        (b"\xff\xfe\x00".decode("latin-1") + "\x00", "is not valid YAML"),
    ],
)
def test_bad_file(tmp_path: Path, text: str, message: str):
    """Oracle: the sentence names the file."""
    (tmp_path / "rig.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_rig(tmp_path / "rig.yaml")
    assert "rig.yaml" in str(caught.value)


def test_missing_binary_or_folder(tmp_path: Path):
    """Oracle: each is told apart in words."""
    with pytest.raises(InputError, match="no such file"):
        load_rig(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(InputError, match="is not a text file"):
        load_rig(tmp_path / "binary.yaml")
    with pytest.raises(InputError, match="is a folder"):
        load_rig(tmp_path)


def test_kannala_brandt_is_opencvs_fisheye(tmp_path: Path):
    """Oracle: OpenCV's name of the same polynomial."""
    data = _data()
    data["camera"] |= {"model": "kannala_brandt", "distortion": [0.1, 0.02]}
    assert _load(tmp_path, data).camera.model == "opencv_fisheye"


def test_camera_survives_model_and_back(tmp_path: Path):
    """Oracle: the identity."""
    camera = _load(tmp_path, _data()).camera
    assert Camera.from_model(camera.to_model()) == camera


NAMES = [("camera_matrix", "distortion_coefficients"), ("cameraMatrix", "distCoeffs"), ("K", "D")]


@pytest.mark.parametrize("suffix", ["yaml", "yml", "xml", "json"])
@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("fisheye", [False, True])
def test_opencv_file_storage(tmp_path: Path, suffix: str, names: tuple[str, str], fisheye: bool):
    """Oracle: the values that OpenCV's own writer stored."""
    distortion = np.array([[0.1, -0.2, 0.001, 0.002]])
    storage = cv2.FileStorage(str(tmp_path / f"cam.{suffix}"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 427)
    storage.write("image_height", 342)
    storage.write("fisheye_model", int(fisheye))
    storage.write(names[0], np.array(K))
    storage.write(names[1], distortion)
    storage.release()
    camera = _load(tmp_path, _with("camera", f"cam.{suffix}")).camera
    assert camera.model == ("opencv_fisheye" if fisheye else "opencv")
    assert (camera.width, camera.height) == (427, 342)
    assert camera.K == K
    assert camera.distortion == distortion.ravel().tolist()


HEADER = "%YAML:1.0\n---\n"
MATRIX = "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ {} ]\n"
SIZE = "image_width: 427\nimage_height: 342\n"
GOOD = "400., 0., 210., 0., 395., 168., 0., 0., 1."


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such file; check `camera` in the rig file"),
        ("hello", "is not an OpenCV FileStorage"),
        (HEADER + SIZE, "camera_matrix is missing"),
        (HEADER + SIZE + "camera_matrix: 7\n", "is not an OpenCV calibration"),
        (HEADER + MATRIX.format(GOOD), "image_width or image_height is missing"),
        (
            HEADER + SIZE + MATRIX.format(GOOD.replace("395.", ".Nan")),
            "holds a matrix that is none",
        ),
        (HEADER + SIZE + MATRIX.format(GOOD.replace("395.", "-5.")), "K: the focal lengths"),
    ],
)
def test_bad_file_storage(tmp_path: Path, text: str | None, message: str):
    """Oracle: the sentence names the camera file, not the rig file that points to it."""
    if text is not None:
        (tmp_path / "cam.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        _load(tmp_path, _with("camera", "cam.yaml"))
    assert str(caught.value.where).startswith(str(tmp_path / "cam.yaml"))
    assert message in str(caught.value)

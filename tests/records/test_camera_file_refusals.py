"""Camera files that are refused by name, what is told of the others, and the manual's tables."""

import json
import re
from pathlib import Path

import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.camera_files import FORMATS, lenses, matrices, read_camera_file
from mitsuba_endo.records.rig import load_rig, read_rig
from tests.records.camera_file_inputs import (
    BROWN,
    PINHOLE,
    K,
    check,
    kalibr,
    ros,
    write,
)

MANUAL = (Path(__file__).parents[2] / "docs" / "rig.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"K": K, "k_1": -0.1}, "the key 'k_1' beside K is not known"),
        ({"K": K, "k1": -0.1, "k2": 0.1}, "the key 'k1' beside K is not known"),
        ({"K": K, "p1": 1e-3}, "the key 'p1' beside K is not known"),
        ({"camera_matrix": K, "lens_parameters": BROWN}, "the key 'lens_parameters' beside camera"),
        ({"K": K, "k": BROWN}, "the key 'k' beside K is not known"),
        ({"K": K, "D": BROWN, "dist": BROWN}, "the keys 'D' and 'dist' are both distortion"),
        ({"K": K, "D": BROWN, "model": "fov"}, "the camera model 'fov' is not known"),
        ({"K": K, "D": BROWN, "model": "none"}, "the model is 'none', and coefficients follow"),
        ({"K": K, "D": [*BROWN[:4], 1e-3], "model": "fisheye"}, "coefficient 5 is 0.001, and the"),
        ({"K": K, "D": BROWN, "model": "plumb_bob", "xi": 1.1}, "and xi beside it says omni"),
        ({"K": K, "model": "radtan", "fisheye_model": 1}, "and fisheye_model beside it says fish"),
        ({"K": K, "D": "strong"}, "is not a list of numbers, got 'strong'"),
        (
            {"fx": 1.0, "fy": 1.0, "cx": 0, "cy": 0, "k7": 1.0},
            "the key 'k7' beside fx is not known",
        ),
        ({"fx": 1.0, "fy": 1.0, "cx": 0, "cy": 0, "skew": 1.0}, "the key 'skew' beside fx"),
        ({"fx": 1.0, "fy": 1.0, "cx": 0, "cy": 0, "D": BROWN, "k1": 1.0}, "the key 'k1' beside D"),
        ({"fx": 1.0, "fy": 1.0}, "cx or cy is missing"),
        ({"cam0": kalibr("eucm", [0.5, 1, *PINHOLE], "none", [])}, "the camera model 'eucm'"),
        ({"cam0": kalibr("pinhole", PINHOLE, "fov", [0.9])}, "the camera model 'fov'"),
        ({"cam0": kalibr("ds", [-0.2, 0.5, *PINHOLE], "radtan", [0.1])}, "is ds with radtan"),
        ({"cam0": kalibr("ds", PINHOLE, "none", [])}, "ds has 6 intrinsics"),
        ({"cam0": kalibr("pinhole", PINHOLE, "none", []) | {"k": 1}}, "the key 'k' is not known"),
        ("1 FOV 240 180 200 200 120 90 0.9\n", "the camera model 'FOV' is not known"),
        ("1 OPENCV 240 180 200 200 120 90 0.9\n", "OPENCV has 8 parameters, not 5"),
        ("1 PINHOLE 240 180 1 1 1 1\n2 PINHOLE 240 180 1 1 1 1\n", "holds the cameras 1, 2"),
        ("just words", "is not an OpenCV FileStorage or another camera file"),
        ({"some": "thing"}, "camera_matrix is missing"),
    ],
)
def test_what_is_not_known_is_refused_by_name(tmp_path, content, message):
    """Oracle: the sentence names the key, the model or the coefficient, and the file."""
    path = write(tmp_path / "c.yaml", content)
    with pytest.raises(InputError) as caught:
        read_camera_file(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value.where)


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        ("{file: c.yaml}", "image_width or image_height is missing; add them, or write camera:"),
        ("{file: c.yaml, width: 240, height: 180, fx: 3}", "camera.fx: unknown key beside file"),
        ("{file: s.yaml, width: 241, height: 180}", "camera.width: is 241, and 240 in s.yaml"),
    ],
)
def test_the_rig_adds_the_size_and_nothing_else(tmp_path, camera, message):
    """Oracle: the sentence."""
    write(tmp_path / "c.yaml", {"K": K})
    write(tmp_path / "s.yaml", {"K": K, "image_size": [240, 180]})
    rig = write(tmp_path / "rig.yaml", f"camera: {camera}\nprojector: {{width: 9, height: 9}}\n")
    with pytest.raises(InputError) as caught:
        load_rig(rig)
    assert message in str(caught.value)
    text = rig.read_text().replace(camera, "{file: c.yaml, width: 240, height: 180}")
    check(load_rig(write(rig, text)).camera, distortion=[])
    known = text.replace("height: 180}", "height: 180, K_std: [1, 1, 2, 2]}")
    assert load_rig(write(rig, known)).camera.K_std == [1, 1, 2, 2]
    text = text.replace("{width: 9, height: 9}", "{file: c.yaml, width: 9, height: 9}")
    with pytest.raises(InputError, match="holds no projector"):
        load_rig(write(rig, text))


def test_a_note_says_what_was_read(tmp_path):
    """Oracle: the sentence, for a file that names its model and one that does not."""
    write(tmp_path / "c.yaml", ros())
    _, (note,) = read_rig(
        write(tmp_path / "rig.yaml", "camera: c.yaml\nprojector: {width: 9, height: 9}\n")
    )
    assert note == (
        "c.yaml is read as ROS camera_info: camera model opencv, as it says (plumb_bob); fx 200.5, "
        "fy 199, cx 120.4, cy 88.6, coefficients k1 -0.1, k2 0.02, p1 0.001, p2 -0.002, k3 0.003."
    )
    _, silent = read_camera_file(write(tmp_path / "d.json", {"K": K}))
    assert "camera model opencv, the file names no model;" in silent
    assert silent.endswith("no distortion.")


WRONG = [None, "x", [], {}, -1, 1e308, float("nan"), [1, [2]], True, [None] * 9, [[1, 2, 3]] * 3]


def parts(value: object, path: tuple = ()) -> list[tuple]:
    """Return the paths of all parts of nested mappings and lists."""
    if isinstance(value, dict | list):
        inner = value.items() if isinstance(value, dict) else enumerate(value)
        return [path, *(p for key, part in inner for p in parts(part, (*path, key)))]
    return [path]


@pytest.mark.parametrize(
    "content",
    [
        ros(), {"cam0": kalibr("ds", [-0.2, 0.57, *PINHOLE], "none", [])},
        {"K": K, "dist": BROWN, "image_size": [240, 180]},
        {"RadialDistortion": [0.1, 0.2], "FocalLength": [1.0, 2.0], "PrincipalPoint": [3.0, 4.0],
         "ImageSize": [5, 6]},
        {"fx": 1.0, "fy": 2.0, "cx": 3.0, "cy": 4.0, "k1": 0.1, "width": 5, "height": 6},
        {"cam_int": K, "cam_dist": BROWN, "proj_int": K, "rotation": K, "translation": [1, 2, 3.0]},
        {"Cameras": ["C"], "Projectors": ["P"], "C": {"cameraMatrix": K, "R": K, "T": [1, 2, 3]},
         "P": {"cameraMatrix": K, "R": K, "T": [1, 2, 3]}},
    ],
)  # fmt: skip
def test_any_part_may_be_wrong(tmp_path, content):
    """Oracle: a refusal in a sentence, or a camera; never another exception."""
    rig = "camera: {file: c.json, width: 240, height: 180}\nprojector: {width: 9, height: 9}\n"
    write(tmp_path / "rig.yaml", rig)
    refused = 0
    for number, path in enumerate(parts(content)[1:]):
        broken = json.loads(json.dumps(content))
        part = broken
        for key in path[:-1]:
            part = part[key]
        part[path[-1]] = WRONG[number % len(WRONG)]
        write(tmp_path / "c.json", broken)
        try:
            load_rig(tmp_path / "rig.yaml")
        except InputError:
            refused += 1
    assert refused > 3


def test_the_manual_names_every_format_and_name():
    """Oracle: the tables in docs/rig.md, row by row."""
    for name in FORMATS:
        assert f"| {name} |" in MANUAL, name
    rows = {
        "camera matrix": matrices.MATRIX, "distortion": matrices.DISTORTION,
        "width": matrices.WIDTH, "height": matrices.HEIGHT, "width and height": matrices.SIZE,
        "height and width": matrices.SHAPE, "model": matrices.MODEL,
        **{f"`{model}` is meant by": names for model, names in lenses.MODELS.items()},
    }  # fmt: skip
    for what, names in rows.items():
        (listed,) = re.findall(rf"^\| {re.escape(what)} \| (.*) \|$", MANUAL, re.MULTILINE)
        assert set(re.findall(r"`(\w+)`", listed)) == {name for name in names if name}, what

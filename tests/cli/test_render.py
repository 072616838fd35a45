"""``render`` writes a capture that other programs can read and that keeps the answer to itself."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.rig import load_rig
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.records.surface import load_surface
from tests.cli.inputs import run

WIDTH, HEIGHT = 56, 38
SETTINGS = ("width=56", "height=38", "fx=47", "cx=29.1", "cy=17.3", "focal=310")


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("render") / "out"
    sets = [part for setting in SETTINGS for part in ("--set", setting)]
    result = run("render", "sheet", "--out", out, *sets, "--spp", 4, "--json", "--debug")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert (summary["width"], summary["height"]) == (WIDTH, HEIGHT)
    return out


def test_truth_explains_the_map(capture: Path):
    """Oracle: the geometry package: depth image to points, through truth's pose and law, to q."""
    truth = load_solution(capture / "truth.json")
    rig = load_rig(capture / "rig.yaml")
    map_ = load_map(capture / "map.exr")
    depth = read_exr(capture / "depth.exr")["Z"]
    assert map_.q.shape == (HEIGHT, WIDTH, 2)
    assert map_.valid.mean() > 0.5
    assert truth.projector.focal.value == 310
    model, pose = truth.projector.to_model(), truth.frames[0].projector_from_camera.to_transform()
    assert model is not None
    assert pose is not None
    camera = rig.camera.to_model()
    rays = camera.rays(camera.pixel_grid())
    points = rays / rays[..., 2:] * depth[..., None]
    expected = model.project(pose.apply(points))
    np.testing.assert_allclose(map_.q[map_.valid], expected[map_.valid], atol=5e-3)


def test_true_surface_is_in_the_camera_frame(capture: Path):
    """Oracle: every pixel's point, from the depth image, lies inside the surface's extent."""
    surface = load_surface(capture / "truth_surface.ply")
    depth = read_exr(capture / "depth.exr")["Z"]
    assert surface.vertices[:, 2].min() <= np.nanmin(depth) + 1e-3
    assert surface.vertices[:, 2].max() >= np.nanmax(depth) - 1e-3


def test_rig_is_known_input_only(capture: Path):
    """Oracle: the scene's settings: camera given, focal length and pose left out."""
    text = (capture / "rig.yaml").read_text()
    data = yaml.safe_load(text)
    assert data["camera"]["K"][0] == pytest.approx([47, 0, 29.1])
    assert data["projector"]["focal"] == {"refine": True}
    assert "pose" not in data["projector"]
    assert "310" not in text


def test_masks_and_normals(capture: Path):
    """Oracle: lit pixels are seen and have a correspondence; unit normals face the camera."""
    masks, normals = read_exr(capture / "masks.exr"), read_exr(capture / "normals.exr")
    lit = masks["visible"] > 0
    np.testing.assert_array_equal(lit, load_map(capture / "map.exr").valid)
    assert (masks["camera"][lit] > 0).all()
    n = np.stack([normals[f"normal.{c}"] for c in "xyz"], -1)[lit]
    np.testing.assert_allclose(np.linalg.norm(n, axis=-1), 1, atol=1e-3)
    assert (n[:, 2] < 0).mean() > 0.9  # a sheet seen from the front


def test_image(capture: Path):
    """Oracle: OpenCV's PNG reader against the EXR: the same pixels are bright, green dominates."""
    png = cv2.imread(str(capture / "image.png")).astype(float)
    exr = read_exr(capture / "image.exr")
    assert png.shape == (HEIGHT, WIDTH, 3)
    rank = np.corrcoef(png[..., 1].ravel(), np.sqrt(exr["G"]).ravel())[0, 1]
    assert rank > 0.9
    assert exr["G"].mean() > exr["R"].mean()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("no_such_scene",), "no such scene file"),
        (("sheet", "--set", "width"), "'width' is not name=value"),
        (("sheet", "--set", "widht=20"), "widht"),
        (("sheet", "--set", "law=pinole"), "pinole"),
        (("sheet", "--set", "focal=nan"), "'focal' is nan"),
        (("sheet", "--set", "focal=-300"), '"focal" must be a finite number above 0, got -300'),
        (("sheet", "--set", "fx=0"), '"fx" must be a finite number above 0, got 0'),
        (("sheet", "--set", "width=0"), "film are 0 and 360 pixels"),
        (("sheet", "--set", "surface=shape:sheep"), "sheep"),
    ],
)
def test_bad_input(arguments: tuple[str, ...], expected: str, tmp_path: Path):
    """Oracle: the contract of the commands."""
    result = run("render", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2, result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("error: ")
    assert expected in result.stderr
    assert "Traceback" not in result.stderr
    assert list(tmp_path.iterdir()) == []

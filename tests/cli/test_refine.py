"""``refine``, and the refinement within ``decode``."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.correspondence import load_map, write_map
from mitsuba_endo.records.rig import Camera
from tests.cli.inputs import run
from tests.refine.views import GRID, HEIGHT, WIDTH, coordinates, photo, rms, wrong_by

SIZE = (GRID.width, GRID.height)


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    """A rig, an image, the pattern as an image, and a decoder's map with smooth errors."""
    K = np.array([[150.0, 0, 100], [0, 150, 75], [0, 0, 1]])
    camera = Camera.from_model(CameraModel("opencv", WIDTH, HEIGHT, K))
    data = {
        "camera": camera.model_dump(),
        "projector": {"law": "direction_cosine", "width": SIZE[0], "height": SIZE[1]},
    }
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")
    assert cv2.imwrite(str(tmp_path / "image.png"), photo(coordinates()))
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    pattern = 65535 * GRID.brightness(np.stack([x, y], -1))
    assert cv2.imwrite(str(tmp_path / "pattern.png"), np.rint(pattern).astype(np.uint16))
    write_map(tmp_path / "map.npz", wrong_by(coordinates()))
    return tmp_path


def _refine(inputs: Path, *options: object, pattern: str = "", out: str = "out.exr"):
    return run(
        "refine", inputs / "map.npz", "--image", inputs / "image.png", "--rig", inputs / "rig.yaml",
        "--pattern", pattern or inputs / "pattern.png", "--out", inputs / out, *options,
    )  # fmt: skip


@pytest.mark.parametrize("pattern", ["pattern:coded", "pattern.png"])
def test_a_map_of_another_decoder_is_refined(inputs: Path, pattern: str):
    """Oracle: the exact coordinates; the pattern by its name, or as nothing but an image."""
    name = pattern if pattern.startswith("pattern:") else str(inputs / pattern)
    result = _refine(inputs, "--json", pattern=name)
    assert result.exit_code == 0, result.stderr
    found = load_map(inputs / "out.exr")
    assert rms(load_map(inputs / "map.npz").q, coordinates()) > 0.5
    assert rms(found.q, coordinates()) < 0.08
    assert found.covariance is not None
    assert found.correlation_px
    assert json.loads(result.stdout)["refined"] > 0.95


def test_an_image_that_confirms_nothing_keeps_the_map(inputs: Path):
    """Oracle: the map's own coordinates, exit code 1, and the sentence."""
    assert cv2.imwrite(str(inputs / "image.png"), np.zeros((HEIGHT, WIDTH), np.uint8))
    result = _refine(inputs)
    assert result.exit_code == 1
    assert "not refined: the image confirms 0.0 % of the map's pixels" in " ".join(
        result.stdout.split()
    )
    np.testing.assert_array_equal(load_map(inputs / "out.exr").q, load_map(inputs / "map.npz").q)


def test_bad_input_is_named(inputs: Path):
    """Oracle: exit code 2, the file, and what is wrong with it; nothing is written."""
    small = inputs / "small.png"
    assert cv2.imwrite(str(small), np.zeros((20, 30), np.uint8))
    flat = inputs / "flat.png"
    assert cv2.imwrite(str(flat), np.full(SIZE[::-1], 90, np.uint8))
    for pattern, words in (
        (str(small), "small.png: is 30 x 20 pixels and the rig's projector.width"),
        (str(flat), "flat.png: is one even colour"),
        (str(inputs / "none.png"), "none.png: no such image"),
        ("pattern:dots", "pattern 'dots' has no code"),
    ):
        result = _refine(inputs, pattern=pattern)
        assert result.exit_code == 2
        assert words in result.stderr
    assert cv2.imwrite(str(inputs / "image.png"), np.zeros((20, 30), np.uint8))
    result = _refine(inputs)
    assert result.exit_code == 2
    assert "map.npz: the image is 30 x 20 pixels and the map 200 x 150" in result.stderr
    result = _refine(inputs, "--pattern-gamma", "2.2", pattern="pattern:coded")
    assert result.exit_code == 2
    assert "--pattern-gamma: is for patterns given as images" in result.stderr
    assert not (inputs / "out.exr").exists()


def test_a_map_of_a_larger_pattern_is_refused(inputs: Path):
    """Oracle: the sentence, which names the map and both sizes."""
    map_ = load_map(inputs / "map.npz")
    write_map(inputs / "map.npz", replace(map_, q=map_.q + 300))
    result = _refine(inputs)
    assert result.exit_code == 2
    assert "map.npz: its coordinates reach from" in result.stderr


def test_maps_have_no_image_to_be_refined_on(inputs: Path):
    """Oracle: the sentence; ``calibrate`` refines photographs, not maps."""
    result = run(
        "calibrate", inputs / "map.npz", "--rig", inputs / "rig.yaml", "--out", inputs / "result",
        "--no-refine",
    )  # fmt: skip
    assert result.exit_code == 2
    assert "--no-refine: is for images, and maps are given" in result.stderr

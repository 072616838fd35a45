"""Captures: image, exact geometry and truth belong together."""

import numpy as np
import pytest

from mitsuba_endo.rendering.render import Capture, render_capture
from mitsuba_endo.rendering.scene import LoadedScene, load_scene

SMALL = {"width": 64, "height": 46, "fx": 52, "cx": 30.2, "cy": 25.1}


@pytest.fixture
def rabbit(llvm: str) -> tuple[LoadedScene, Capture]:
    pose = {"projector_origin": "28, -6, -3", "projector_target": "0, 1, 72"}
    loaded = load_scene("rabbit", **SMALL, **pose, surface="shape:rabbit?edge=2")
    return loaded, render_capture(loaded, spp=4, seed=2, name="one")


def test_truth_explains_the_capture(rabbit: tuple[LoadedScene, Capture]) -> None:
    """Oracle: depth along the true camera's rays, projected by the true projector in NumPy."""
    _, capture = rabbit
    truth = capture.truth
    camera, projector = truth.first.camera, truth.first.projector
    pose = truth.first.projector_from_camera
    rays = camera.rays(camera.pixel_grid())
    points = rays / rays[..., 2:] * capture.depth[..., None]
    seen = capture.camera_mask
    assert 0.05 < seen.mean() < 0.5
    q = projector.project(pose.apply(points)[seen])
    np.testing.assert_allclose(capture.projector[seen], q, atol=2e-3)
    assert np.isnan(capture.projector[~seen]).all()
    assert truth.frames[0].name == "one"
    assert projector.focal == 300


def test_correspondences_are_those_that_are_lit(rabbit: tuple[LoadedScene, Capture]) -> None:
    """Oracle: the visibility mask."""
    _, capture = rabbit
    np.testing.assert_array_equal(np.isfinite(capture.correspondences()[..., 0]), capture.visible)
    assert (capture.camera_mask & ~capture.visible).any()  # something lies in shadow


def test_normals_face_the_camera_and_agree_with_depth(llvm: str) -> None:
    """Oracle: cross product of neighbouring points of a plane, OpenCV axes."""
    loaded = load_scene("plane", **SMALL)
    capture = render_capture(loaded, spp=1)
    camera = loaded.camera()
    rays = camera.rays(camera.pixel_grid())
    points = rays / rays[..., 2:] * capture.depth[..., None]
    expected = np.cross(points[12, 10] - points[10, 10], points[10, 30] - points[10, 10])
    expected /= np.linalg.norm(expected)
    assert expected[2] < 0
    np.testing.assert_allclose(capture.normals[10, 10], expected, atol=1e-4)
    assert (np.einsum("hwc,hwc->hw", capture.normals, rays) < 0).all()


def test_the_pattern_falls_where_the_coordinates_say(llvm: str) -> None:
    """Oracle: the pattern looked up at the exact coordinates predicts which pixels are bright."""
    loaded = load_scene(
        "sheet", **SMALL | {"width": 160, "height": 120, "fx": 133, "cx": 80.3, "cy": 58.2},
        light=0, pattern="pattern:grid?width=480&height=384&period=36&line=0.12",
    )  # fmt: skip
    capture = render_capture(loaded, spp=64)
    q = capture.correspondences()
    from_line = np.abs((q - [239.5, 191.5]) / 36 - np.round((q - [239.5, 191.5]) / 36)).min(-1)
    green = capture.image[..., 1]
    on, off = green[from_line < 0.05], green[from_line > 0.4]
    assert len(on) > 100
    assert len(off) > 100
    assert np.median(on) > 8 * np.median(off)
    assert np.quantile(on, 0.05) > np.quantile(off, 0.95)


def test_seed_changes_noise_only(llvm: str) -> None:
    """Oracle: same seed, same image; another seed, another image and the same geometry."""
    loaded = load_scene("plane", **SMALL)
    first, again, other = (render_capture(loaded, spp=2, seed=s) for s in (1, 1, 2))
    np.testing.assert_array_equal(first.image, again.image)
    assert (first.image != other.image).any()
    np.testing.assert_array_equal(first.projector, other.projector)

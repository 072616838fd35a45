"""Camera models against OpenCV, and their inverses."""

import cv2
import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CAMERAS, CameraModel

K = np.array([[310.0, 0, 241.5], [0, 295.0, 160.2], [0, 0, 1]])
BROWN = (
    (),
    (-0.21, 0.05),
    (-0.21, 0.05, 1.5e-3, -2e-3),
    (-0.21, 0.05, 1.5e-3, -2e-3, -0.004),
    (0.4, 0.03, 1.5e-3, -2e-3, 0.002, 0.7, 0.1, 0.01),
)
FISHEYE = ((), (0.02, -0.01, 0.004, -0.001))


def camera(model: str, distortion: tuple[float, ...]) -> CameraModel:
    return CameraModel(model, width=480, height=320, K=K, distortion=distortion)


def scattered_points() -> np.ndarray:
    rng = np.random.default_rng(4)
    xy = rng.uniform([-0.7, -0.5], [0.6, 0.55], (200, 2))
    return np.column_stack([xy, np.ones(200)]) * rng.uniform(5, 90, (200, 1))


@pytest.mark.parametrize("distortion", BROWN)
def test_brown_projection_is_opencvs(distortion: tuple[float, ...]) -> None:
    """Oracle: cv2.projectPoints."""
    points = scattered_points()
    padded = np.zeros(8)
    padded[: len(distortion)] = distortion
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, padded)
    np.testing.assert_allclose(
        camera("opencv", distortion).project(points), expected[:, 0], atol=1e-9
    )


@pytest.mark.parametrize("distortion", FISHEYE)
def test_fisheye_projection_is_opencvs(distortion: tuple[float, ...]) -> None:
    """Oracle: cv2.fisheye.projectPoints."""
    points = scattered_points()
    padded = np.zeros(4)
    padded[: len(distortion)] = distortion
    expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, padded)
    np.testing.assert_allclose(
        camera("opencv_fisheye", distortion).project(points), expected[:, 0], atol=1e-9
    )


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("opencv", d) for d in BROWN] + [("opencv_fisheye", d) for d in FISHEYE],
)
def test_rays_project_back_to_their_pixels(model: str, distortion: tuple[float, ...]) -> None:
    """Oracle: the identity, over all pixels of the image."""
    cam = camera(model, distortion)
    pixels = cam.pixel_grid()
    assert pixels.shape == (320, 480, 2)
    np.testing.assert_array_equal(pixels[7, 11], [11, 7])
    np.testing.assert_allclose(cam.project(cam.rays(pixels)), pixels, atol=1e-7)


def test_fisheye_sees_beyond_90_degrees() -> None:
    """Oracle: the identity for directions behind the image plane."""
    cam = camera("opencv_fisheye", FISHEYE[1])
    angle = np.radians([92, 100, 108])
    rays = np.stack([np.sin(angle) * 0.6, np.sin(angle) * -0.8, np.cos(angle)], -1)
    np.testing.assert_allclose(cam.rays(cam.project(rays)), rays, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("opencv", d) for d in BROWN] + [("opencv_fisheye", d) for d in FISHEYE],
)
def test_density_is_pixel_area_per_solid_angle(model: str, distortion: tuple[float, ...]) -> None:
    """Oracle: determinant of central differences of ``normalise`` along two tangents."""
    law = CAMERAS[model]
    d = scattered_points()
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    first = np.cross(d, [0.1, 1.0, 0.2])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(d, first)
    step = 1e-5

    def slope(tangent: np.ndarray) -> np.ndarray:
        ends = [law.normalise(distortion, *(d + s * step * tangent).T) for s in (1, -1)]
        return (np.array(ends[0]) - np.array(ends[1])) / (2 * step)

    (ax, bx), (ay, by) = slope(first), slope(second)
    area, unfolded = law.density(distortion, *d.T)
    assert unfolded.all()
    np.testing.assert_allclose(area, abs(ax * by - ay * bx), rtol=1e-6)


def test_folded_directions_are_recognised() -> None:
    """Strong barrel distortion x (1 + k1 r^2) turns back at r = 1 / sqrt(-3 k1)."""
    k1 = -0.5
    fold = 1 / np.sqrt(-3 * k1)
    r = np.array([0.95, 1.05, 3.0]) * fold
    _, unfolded = CAMERAS["opencv"].density((k1,), 0.6 * r, -0.8 * r, np.ones(3))
    np.testing.assert_array_equal(unfolded, [True, False, False])

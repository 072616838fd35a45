"""Ray casting against closed forms."""

import numpy as np

from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.geometry.cameras import CameraModel

CAMERA = CameraModel(
    "opencv", 41, 29, np.array([[30.0, 0, 18], [0, 33, 15], [0, 0, 1]]), (-0.1, 0.01)
)
SQUARE = np.array([[-30.0, -20, 60], [25, -20, 66], [25, 35, 74], [-30, 35, 68]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_plane_seen_by_a_distorted_camera(llvm: str):
    """Oracle: ray and plane in closed form; the square's outline by its bounds in x and y."""
    found = range_image(RayCaster(SQUARE, FACES), CAMERA)
    rays = CAMERA.grid_rays
    normal = np.cross(SQUARE[1] - SQUARE[0], SQUARE[3] - SQUARE[0])
    assert abs(normal @ (SQUARE[2] - SQUARE[0])) < 1e-9  # the fourth corner is in the plane
    expected = (normal @ SQUARE[0]) / (rays @ normal)
    points = rays * expected[..., None]
    low, high = SQUARE.min(0)[:2], SQUARE.max(0)[:2]
    inside = ((points[..., :2] > low) & (points[..., :2] < high)).all(-1) & (expected > 0)
    assert 0.2 < inside.mean() < 0.95
    np.testing.assert_array_equal(np.isfinite(found), inside)
    np.testing.assert_allclose(found[inside], expected[inside], rtol=1e-12)


def test_origin_elsewhere_and_the_nearer_of_two(llvm: str):
    """Oracle: distances along z to two parallel squares, from in front of and between them."""
    vertices = np.concatenate([SQUARE * [1, 1, 0] + [0, 0, 50], SQUARE * [1, 1, 0] + [0, 0, 80]])
    caster = RayCaster(vertices, np.concatenate([FACES, FACES + 4]))
    forward = np.array([[0.0, 0, 1], [0, 0, -1], [1, 0, 0]])
    np.testing.assert_allclose(caster.range(np.array([1.0, 2, 0]), forward), [50, np.nan, np.nan])
    np.testing.assert_allclose(caster.range(np.array([1.0, 2, 60]), forward), [20, 10, np.nan])

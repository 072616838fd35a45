"""Signed distances between voxels."""

import numpy as np
import pytest

from mitsuba_endo.fusion import RangeFrame, Volume
from mitsuba_endo.fusion.interpolate import interpolate
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform

NORMAL = np.array([0.2, -0.3, -1.0]) / np.linalg.norm([0.2, -0.3, -1.0])
HEIGHT = 20.0


@pytest.fixture(scope="module")
def volume() -> Volume:
    """A slanted plane, 20 mm from the camera."""
    K = np.array([[80.0, 0, 60], [0, 80.0, 45], [0, 0, 1]])
    camera = CameraModel("opencv", 120, 90, K)
    ranges = -HEIGHT / (camera.grid_rays @ NORMAL)
    volume = Volume(0.4)
    volume.integrate(RangeFrame(ranges, camera, RigidTransform.identity()))
    return volume


def test_distance_and_gradient_of_a_plane(volume: Volume) -> None:
    """Oracle: n . x + 20, which is linear, so interpolation is exact but for single precision."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-3, 3, (500, 3))
    points -= ((points @ NORMAL + HEIGHT) - rng.uniform(-0.8, 0.8, 500))[:, None] * NORMAL
    found = interpolate(volume, points)
    assert found.observed.mean() > 0.95
    wanted = points @ NORMAL + HEIGHT
    assert found.distance[found.observed] == pytest.approx(wanted[found.observed], abs=1e-3)
    normals = np.broadcast_to(NORMAL, (int(found.observed.sum()), 3))
    assert found.gradient[found.observed] == pytest.approx(normals, abs=5e-3)


def test_nothing_is_known_where_nothing_was_seen(volume: Volume) -> None:
    far = np.array([[0.0, 0.0, -30.0], [500.0, 0.0, 0.0]])
    found = interpolate(volume, far)
    assert not found.observed.any()
    assert (found.distance == 0).all()
    assert not interpolate(Volume(1.0), far).observed.any()

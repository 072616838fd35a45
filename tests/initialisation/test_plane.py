"""The published start."""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.initialisation.plane import plane_start
from tests.rigs import random_rig


@pytest.fixture(scope="module")
def rig():
    return random_rig(3)


def test_is_a_plane_seen_by_a_front_parallel_projector(rig):
    """Oracle: depth times ray has z = distance; R = I, t the direction, f the given one."""
    start = plane_start(rig.q, rig.camera, rig.projector, distance=9.0, direction=(0, 2.0, 0))
    points = start.depth[..., None] * rig.camera.grid_rays
    np.testing.assert_allclose(points[start.used, 2], 9.0, rtol=1e-12)
    assert np.isnan(start.depth[~np.isfinite(rig.q[..., 0])]).all()
    np.testing.assert_array_equal(start.projector_from_camera.R, np.eye(3))
    np.testing.assert_array_equal(start.projector_from_camera.t, [0, 1, 0])
    assert start.projector.focal == rig.projector.focal


def test_default_projector_is_to_the_right(rig):
    """Oracle: a projector at +x sees the camera's points shifted by -x."""
    start = plane_start(rig.q, rig.camera, rig.projector, distance=9.0)
    np.testing.assert_array_equal(start.projector_from_camera.t, [-1, 0, 0])


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"distance": -1.0}, "distance -1.0"),
        ({"distance": float("nan")}, "distance nan"),
        ({"distance": 9.0, "direction": (0, 0, 0)}, "direction"),
    ],
)
def test_refuses_values_without_meaning(rig, change, says):
    """Oracle: the sentence names the value."""
    with pytest.raises(InputError, match=says):
        plane_start(rig.q, rig.camera, rig.projector, **change)


def test_needs_a_focal_length(rig):
    """Oracle: nothing is estimated, so an unknown focal length cannot start."""
    with pytest.raises(InputError, match="focal"):
        plane_start(rig.q, rig.camera, rig.unknown_projector, distance=9.0)

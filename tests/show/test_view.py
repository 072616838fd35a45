"""The view of the surface against closed forms."""

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.show.view import view_surface

CAMERA = CameraModel("opencv", 31, 23, np.array([[30.0, 0, 13], [0, 33, 12], [0, 0, 1]]), (-0.1,))
PLANE = np.array([[-30.0, -20, 60], [35, -20, 66.5], [35, 25, 71], [-30, 25, 64.5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("flip", [False, True])
def test_plane(flip: bool):
    """Oracle: ray and plane; its normal towards the camera; a std that is linear in x and y."""
    std = 0.2 + 0.001 * PLANE[:, 0] - 0.002 * PLANE[:, 1]
    faces = FACES[:, ::-1] if flip else FACES
    view = view_surface(SurfaceEstimate(PLANE, faces, std), CAMERA)
    seen = np.isfinite(view.depth)
    assert 0.3 < seen.mean() < 1
    x, y, z = view.points[seen].T
    np.testing.assert_allclose(z, 64 + 0.1 * (x + 10) + 0.1 * y, rtol=1e-9)
    towards = view.points[seen] / np.linalg.norm(view.points[seen], axis=-1, keepdims=True)
    np.testing.assert_allclose(towards, CAMERA.grid_rays[seen], atol=1e-12)
    normal = np.array([0.1, 0.1, -1]) / np.linalg.norm([0.1, 0.1, -1])
    np.testing.assert_allclose(view.normals[seen], np.tile(normal, (seen.sum(), 1)), atol=1e-6)
    assert view.std is not None
    np.testing.assert_allclose(view.std[seen], 0.2 + 0.001 * x - 0.002 * y, rtol=1e-9)
    assert np.isnan(view.std[~seen]).all()


@pytest.mark.usefixtures("llvm")
def test_without_std():
    """Oracle: None stays None."""
    assert view_surface(SurfaceEstimate(PLANE, FACES), CAMERA).std is None

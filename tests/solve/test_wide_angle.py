"""Calibration through omnidirectional cameras."""

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from tests.rigs import bumpy_sheet, cast, with_noise
from tests.solve.problems import NOISE
from tests.solve.test_calibrate import check, run

CAMERAS = {
    "omni": ((0.8, -0.1, 0.02, 1e-3, -2e-3), 92.0),
    "double_sphere": ((-0.2, 0.57), 46.0),
    "scaramuzza": ((0.01, -0.4, 0.05, -0.05, 2e-3, -1e-3), 50.0),
}
"""Coefficients and focal length in pixels of cameras that see 100 degrees or more."""


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("model", CAMERAS)
def test_the_rig_is_found_through_a_wide_lens(model: str):
    """Oracle: the truth of a ray-cast rig, within five stated standard deviations."""
    coefficients, f = CAMERAS[model]
    K = np.array([[f, 0, 63.2], [0, 1.03 * f, 41.8], [0, 0, 1]])
    camera = CameraModel(model, 130, 88, K, coefficients)
    corners = camera.rays(np.array([[0.0, 0.0], [129.0, 87.0]]))
    assert np.degrees(np.arccos(corners[0] @ corners[1])) > 100
    projector = projector_model("direction_cosine", 300.0, (255.5, 199.5))
    pose = RigidTransform.of([0.06, -0.1, 0.15], [-6.0, 1.5, 0.8])
    rig = cast(camera, projector, (512, 400), pose, bumpy_sheet(45.0, (0.1, -0.15), 4.0, 3))
    check(run(with_noise(rig, NOISE, 1)), rig)

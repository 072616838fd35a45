"""Errors of the model: what a calibration says when what was given is wrong, and when it is not.

Oracle: exact views of analytic surfaces with white noise, calibrated with one given value changed.
"""

from functools import cache

import numpy as np
import pytest

from mitsuba_endo.geometry.laws import projector_model
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Projector, Rig, Scale
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from ..rigs import bumpy_sheet, cast, lopsided_camera, with_noise, with_outliers
from .problems import POSE

pytestmark = pytest.mark.usefixtures("llvm")

FOCAL = 410.0


@cache
def solved(k1: float = 0.0, centre: float = 0.0) -> Solution:
    """Calibrate with the camera's k1 and the projector's centre off by so much."""
    camera, size = lopsided_camera(128, 96), (512, 400)
    projector = projector_model("direction_cosine", FOCAL, (250.0, 205.0))
    rig = cast(camera, projector, size, POSE, bumpy_sheet(70.0, (0.2, -0.1), 6.0, 4))
    rig = with_outliers(with_noise(rig, 0.2, 1), 0.1, 2)
    given = Rig(
        camera=Camera(
            width=128, height=96, K=np.array(camera.K).tolist(),
            distortion=[camera.distortion[0] + k1, *camera.distortion[1:]],
        ),
        projector=Projector(
            law="direction_cosine", width=512, height=400, centre=[250.0 + centre, 205.0]
        ),
        scale=Scale(baseline=rig.baseline),
    )  # fmt: skip
    map_ = CorrespondenceMap(q=rig.q.astype(np.float32), name="a")
    return calibrate([map_], given, Options(check_model=True)).solution


def test_a_right_model_is_not_suspected() -> None:
    solution = solved()
    assert not solution.model["suspected"]
    assert solution.model["design_effect"] < 2
    assert solution.model["carried"] == []
    assert solution.verdict[-1] == "Model: the residuals look like noise."
    assert not any("residuals" in w for w in solution.warnings)
    assert solution.projector.centre.status == "fixed"


def test_a_wrong_distortion_is_named_with_its_value() -> None:
    solution = solved(k1=0.01)
    assert solution.model["suspected"]
    named = {c["key"]: c for c in solution.model["candidates"][:2]}
    assert named["camera_distortion.k1"]["value"] == pytest.approx(-0.01, abs=0.002)
    (warning,) = [w for w in solution.warnings if "does not explain" in w]
    assert "camera distortion (k1) looks" in warning
    assert "--share camera_distortion=shared" in warning


@pytest.mark.parametrize("error", [{"k1": 0.01}, {"centre": 12.0}])
def test_the_interval_holds_the_truth_though_the_model_is_wrong(error: dict[str, float]) -> None:
    """Oracle: the focal length, to 1 %; the formal deviation alone is far too small."""
    focal = solved(**error).projector.focal
    assert isinstance(focal.value, float)
    assert isinstance(focal.std, float)
    assert abs(focal.value - FOCAL) < min(3 * focal.std, 0.01 * FOCAL)
    assert focal.std < 0.02 * FOCAL, "an interval that holds everything tells nothing"


def test_relief_is_not_blamed_for_an_error_of_the_model() -> None:
    solution = solved(k1=0.3)
    text = " ".join([*solution.verdict, *solution.warnings])
    assert solution.model["suspected"]
    assert "relief is too small" not in text

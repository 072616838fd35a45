"""Errors of the model: what a calibration says when what was given is wrong, and when it is not.

Oracle: exact views of analytic surfaces with white noise, calibrated with one given value changed.
"""

from functools import cache

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import gaussian_filter

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Projector, Rig, Scale, Share
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.reporting import assemble as assemble_module
from mitsuba_endo.solve.reporting.surface_result import surface_estimate

from ..rigs import bumpy_sheet, cast, lopsided_camera, with_noise, with_outliers
from .problems import POSE

pytestmark = pytest.mark.usefixtures("llvm")

FOCAL = 410.0
LAW = "direction_cosine"


@cache
def solved(
    k1: float = 0.0, centre: float = 0.0, law: str = LAW, camera_focal: float = 1.0,
    lens: bool = True, K_std: bool = False, check: bool = True, alike: float = 0.0,
    told: bool = False,
) -> Solution:  # fmt: skip
    """Calibrate with the camera's k1 and the projector's centre off by so much, and so on.

    ``alike``: errors of 0.1 px besides the noise, alike over so many pixels; ``told``: by the map.
    """
    camera, size = lopsided_camera(128, 96), (512, 400)
    projector = projector_model(LAW, FOCAL, (250.0, 205.0))
    rig = cast(camera, projector, size, POSE, bumpy_sheet(70.0, (0.2, -0.1), 6.0, 4))
    rig = with_outliers(with_noise(rig, 0.2, 1), 0.1, 2)
    K = np.array(camera.K) * [[camera_focal, 1, 1], [1, camera_focal, 1], [1, 1, 1]]
    given = Rig(
        camera=Camera(
            width=128, height=96, K=K.tolist(),
            distortion=[camera.distortion[0] + k1, *camera.distortion[1:]] if lens else [],
            K_std=[0.4, 0.4, 1.0, 1.0] if K_std else None,
        ),
        projector=Projector(law=law, width=512, height=400, centre=[250.0 + centre, 205.0]),
        scale=Scale(baseline=rig.baseline),
    )  # fmt: skip
    q = rig.q
    if alike:
        smooth = gaussian_filter(
            np.random.default_rng(5).standard_normal(q.shape), (alike, alike, 0)
        )
        q = q + 0.1 * smooth / smooth.std()
    map_ = CorrespondenceMap(
        q=q.astype(np.float32), name="a", correlation_px=alike if told else None
    )
    return calibrate([map_], given, Options(check_model=check)).solution


@cache
def clamped(moves: float) -> Solution:
    """Calibrate four frames of own surfaces whose projector is said to be clamped."""
    rng = np.random.default_rng(3)
    camera, size = lopsided_camera(128, 96), (512, 400)
    projector = projector_model(LAW, FOCAL, (250.0, 205.0))
    maps = []
    for k in range(4):
        own = type(POSE).of(rng.normal(0, np.radians(moves), 3), np.zeros(3))
        pose = type(POSE)(own.R @ POSE.R, POSE.t)
        rig = cast(camera, projector, size, pose, bumpy_sheet(70.0, (0.2, -0.1), 6.0, 4 + k))
        q = with_outliers(with_noise(rig, 0.2, k), 0.1, k).q.astype(np.float32)
        maps.append(CorrespondenceMap(q=q, name=f"frame {k}"))
    given = Rig(
        camera=Camera.from_model(camera),
        projector=Projector(law=LAW, width=512, height=400, centre=[250.0, 205.0]),
        scale=Scale(baseline=float(np.linalg.norm(POSE.t))),
        share=Share(surface="per_frame", projector_pose="shared"),
    )
    return calibrate(maps, given).solution


def focal_error(solution: Solution) -> float:
    """Return the focal length's error in stated deviations."""
    focal = solution.projector.focal
    assert isinstance(focal.value, float)
    assert isinstance(focal.std, float)
    return abs(focal.value - FOCAL) / focal.std


def test_the_model_is_tested_by_default() -> None:
    assert Options().check_model


def test_a_right_model_is_not_suspected() -> None:
    solution = solved()
    assert not solution.model["suspected"]
    assert solution.model["design_effect"] < 2
    assert solution.model["doubted"] == []
    assert solution.verdict[-1] == "Model: the residuals look like noise."
    assert not any("residuals" in w for w in solution.warnings)


def test_a_right_model_has_the_intervals_of_its_noise() -> None:
    """Oracle: the same calibration without the check."""
    checked, plain = solved().projector.focal, solved(check=False).projector.focal
    assert checked == plain
    assert solved(check=False).model == {}


@pytest.mark.parametrize("error", [{"k1": 0.01}, {"centre": 12.0}])
def test_what_was_given_stays_while_estimates_allow_for_its_error(error: dict[str, float]) -> None:
    """Fixed means fixed. Oracle: the focal length, and the same calibration without the check."""
    checked, plain = solved(**error), solved(**error, check=False)
    value, plainly = checked.projector.focal.value, plain.projector.focal.value
    assert isinstance(value, float)
    assert isinstance(plainly, float)
    assert abs(value - FOCAL) < 0.5 * abs(plainly - FOCAL)
    assert checked.model["corrected"]
    assert "values and intervals allow for errors of what was given" in checked.verdict[-1]
    assert checked.camera == plain.camera
    assert checked.projector.centre == plain.projector.centre
    assert checked.projector.centre.status == "fixed"


def test_a_decoder_s_errors_accuse_nobody_where_the_map_tells_of_them() -> None:
    """Oracle: the focal length, to 1 %; a map that says nothing leaves the model suspected."""
    told, silent = solved(alike=4.0, told=True), solved(alike=4.0)
    assert not told.model["suspected"]
    assert told.model["doubted"] == []
    assert "structure as a decoder's errors have it" in told.verdict[-1]
    assert silent.model["suspected"]
    focal = told.projector.focal
    assert focal_error(told) < 3
    assert isinstance(focal.std, float)
    assert isinstance(focal.std_formal, float)
    assert 1.5 * focal.std_formal < focal.std < 0.01 * FOCAL


@pytest.mark.parametrize("error", [{"lens": False}, {"camera_focal": 1.2}])
def test_a_wrong_model_is_noticed_under_a_decoder_s_errors(error: dict) -> None:
    """Oracle: the error given; candidates take most of such structure away."""
    assert solved(alike=4.0, told=True, **error).model["suspected"]


def test_a_wrong_distortion_is_named_with_its_value() -> None:
    solution = solved(k1=0.01)
    assert solution.model["suspected"]
    named = {c["key"]: c for c in solution.model["candidates"][:2]}
    assert named["camera_distortion.k1"]["value"] == pytest.approx(-0.01, abs=0.002)
    (warning,) = [w for w in solution.warnings if "does not explain" in w]
    assert "camera distortion (k1) looks" in warning
    assert "--share camera_distortion=shared" in warning


@pytest.mark.parametrize(
    ("error", "key"),
    [
        ({"camera_focal": 1.2}, "camera_focal.focal"),
        ({"law": "pinhole"}, f"law.{LAW}"),
        ({"centre": 25.0}, "centre.x"),
        ({"lens": False}, "camera_distortion"),
    ],
)
def test_a_gross_error_is_named_by_refits(error: dict, key: str) -> None:
    """The prediction to first order puts others first for the first two."""
    model = solved(**error).model
    first = model["candidates"][0]
    assert any(k.startswith(key) for k in [first["key"], *first["group_keys"]])


@pytest.mark.parametrize("error", [{"k1": 0.01}, {"centre": 12.0}, {"camera_focal": 1.03}])
def test_the_interval_holds_the_truth_though_the_model_is_wrong(error: dict[str, float]) -> None:
    """Oracle: the focal length; the deviation that trusts the model is far too small."""
    focal = solved(**error).projector.focal
    assert isinstance(focal.value, float)
    assert isinstance(focal.std, float)
    assert focal.std < 0.03 * FOCAL, "an interval that holds everything tells nothing"
    assert isinstance(focal.std_formal, float)
    assert focal_error(solved(**error)) < 2
    trusting = solved(**error, check=False).projector.focal.value
    assert isinstance(trusting, float)
    assert abs(trusting - FOCAL) > 4 * focal.std_formal


@pytest.mark.parametrize("error", [{"k1": 0.01}, {"centre": 12.0}])
def test_the_surface_allows_for_what_is_wrong_too(
    error: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the sheet. Corrected for what was given wrongly, its range is nearer than without."""
    taken: list[SurfaceEstimate] = []
    monkeypatch.setattr(
        assemble_module, "surface_estimate",
        lambda *of: taken.append(surface_estimate(*of)) or taken[-1],
    )  # fmt: skip
    solved.__wrapped__(**error)
    solved.__wrapped__(**error, check=False)
    truth = cast(
        lopsided_camera(128, 96), projector_model(LAW, FOCAL, (250.0, 205.0)), (512, 400), POSE,
        bumpy_sheet(70.0, (0.2, -0.1), 6.0, 4),
    )  # fmt: skip
    seen = np.isfinite(truth.depth)
    points = truth.camera.grid_rays[seen] * truth.depth[seen][:, None]
    range_at = LinearNDInterpolator(points[:, :2] / points[:, 2:], truth.depth[seen])
    errors = [
        float(np.nanmedian(np.abs(np.linalg.norm(V, axis=1) - range_at(V[:, :2] / V[:, 2:]))))
        for V in (s.vertices for s in taken)
    ]
    assert errors[0] < 0.5 * errors[1]
    assert errors[0] < 0.5


def test_a_stated_uncertainty_is_in_the_interval_of_a_right_model_too() -> None:
    """Without a warning: nothing is wrong."""
    solution, exact = solved(K_std=True), solved()
    assert not solution.model["suspected"]
    assert solution.model["doubted"] == ["camera_focal", "camera_centre"]
    assert isinstance(solution.projector.focal.std, float)
    assert isinstance(exact.projector.focal.std, float)
    assert solution.projector.focal.std > 1.2 * exact.projector.focal.std
    assert solution.projector.focal.value == exact.projector.focal.value


def test_relief_is_not_blamed_for_an_error_of_the_model() -> None:
    solution = solved(k1=0.3)
    text = " ".join([*solution.verdict, *solution.warnings])
    assert solution.model["suspected"]
    assert "relief is too small" not in text


def test_a_projector_that_moves_though_said_to_be_clamped_is_named() -> None:
    solution = clamped(moves=1.0)
    assert [p["block"] for p in solution.model["plan"] if p["refuted"]] == ["projector_pose"]
    (warning,) = [w for w in solution.warnings if "does not explain" in w]
    assert "each frame wants its own projector pose" in warning
    assert "use per_frame for it" in warning
    assert not solution.model["corrected"]


def test_a_clamped_projector_is_not_said_to_move() -> None:
    model = clamped(moves=0.0).model
    assert not model["suspected"]
    assert not any(p["refuted"] for p in model["plan"])


def test_what_no_residual_can_check_is_said() -> None:
    """Oracle: the same maps calibrated with a wrong aspect of the projector, which looks as right.

    A pinhole projector before little relief: its pose makes up for its aspect.
    """
    told = little_relief(aspect=1.0)
    found = {u["key"]: u for u in told.model["unchecked"]}
    wrong = little_relief(aspect=1 + found["aspect"]["error"] / 100)
    assert "the residuals look like noise; they would too if" in told.verdict[-1]
    assert not told.model["suspected"]
    assert not wrong.model["suspected"]
    moved = np.subtract(*(s.frames[0].projector_from_camera.t for s in (told, wrong)))
    assert np.abs(moved / told.frames[0].projector_from_camera.std[3:]).max() > 3
    assert solved().model["unchecked"] == []


def little_relief(aspect: float) -> Solution:
    """Calibrate a pinhole projector's view of a sheet that is nearly plane."""
    camera, size = lopsided_camera(128, 96), (512, 400)
    projector = projector_model("pinhole", FOCAL, (250.0, 205.0))
    rig = with_noise(
        cast(camera, projector, size, POSE, bumpy_sheet(70.0, (0.2, -0.1), 3, 4)), 0.2, 1
    )
    given = Rig(
        camera=Camera.from_model(camera),
        projector=Projector(law="pinhole", width=512, height=400, centre=[250.0, 205.0],
                            aspect=aspect, focal={"value": FOCAL}),
        scale=Scale(baseline=rig.baseline),
    )  # fmt: skip
    return calibrate([CorrespondenceMap(q=rig.q.astype(np.float32), name="a")], given).solution

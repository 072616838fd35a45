"""Ambiguous poses are said in the solution. Oracle: the truth, and the plane that it lights."""

import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.records.solution import Solution, load_solution, save_solution
from mitsuba_endo.solve.calibrate import calibrate
from tests.rigs import cast, lopsided_camera, plane, with_noise
from tests.solve.problems import map_of, rig_file

pytestmark = pytest.mark.usefixtures("llvm")

AHEAD = RigidTransform.of([0.1, -0.05, 0.02], [-1.5, 0.8, 5.5])
BESIDE = RigidTransform.of([0.03, -0.12, 0.05], [-6.0, 1.0, 1.5])
PLANE = plane((0.3, -0.2, 1.0), 70.0)
FOCAL = 470.0


def solved(law: str, pose: RigidTransform, *, free: bool) -> Solution:
    projector = projector_model(law, FOCAL, (262.0, 189.0))
    rig = with_noise(cast(lopsided_camera(160, 124), projector, (512, 400), pose, PLANE), 0.2, 0)
    focal = {} if free else {"focal": {"value": FOCAL, "refine": False}}
    return calibrate([map_of(rig, "flat")], rig_file(rig, projector=focal)).solution


def transformed(pose: RigidTransform, law: str) -> np.ndarray:
    """Correspondences of the true plane's points under a pose and the plane that goes with it.

    Where the pose is wrong, so are the points: they are found again as the plane, of those through
    the camera's rays, that reproduces the true correspondences best.
    """
    from scipy.optimize import least_squares

    camera, model = lopsided_camera(160, 124), projector_model(law, FOCAL, (262.0, 189.0))
    rays = camera.rays(camera.pixel_grid())[::8, ::8].reshape(-1, 3)
    q = model.project(AHEAD.apply(PLANE(rays)[:, None] * rays))

    def residual(n: np.ndarray) -> np.ndarray:
        return (model.project(pose.apply(rays / (rays @ n)[:, None])) - q).ravel()

    n = np.array([0.3, -0.2, 1.0]) / 70
    return np.abs(least_squares(residual, n, x_scale=0.01).fun)


@pytest.mark.parametrize(("law", "free"), [("pinhole", False), ("direction_cosine", True)])
def test_planar_twin_is_listed(law: str, free: bool) -> None:
    """One of the two is the truth; either reproduces the map; neither is called measured."""
    solution = solved(law, AHEAD, free=free)
    (other,) = solution.alternatives
    frame = solution.frames[0]
    mine, twin = frame.projector_from_camera.to_transform(), other.to_transform()
    assert mine is not None
    off = [rotation_angle(p.R @ AHEAD.R.T) for p in (mine, twin)]
    assert min(off) < np.radians(0.1) < np.radians(2) < max(off)
    for pose in (mine, twin):
        assert transformed(pose, law).max() < 0.5
        assert np.linalg.norm(pose.t) == pytest.approx(np.linalg.norm(AHEAD.t))
    assert other.frames == ["flat"]
    assert not other.decided
    assert frame.projector_from_camera.status == "weak"
    assert "see alternatives" in (frame.projector_from_camera.reason or "")
    assert any(other.reason in line for line in solution.verdict)
    assert "other pose of a plane" in other.reason
    if free:
        assert solution.projector.focal.status == "measured"


def test_twin_rejected_by_depth() -> None:
    """Oracle: with a sideways baseline the other pose puts the plane behind the projector."""
    solution = solved("direction_cosine", BESIDE, free=True)
    assert solution.alternatives == []
    assert solution.frames[0].projector_from_camera.status == "measured"
    assert not any("Alternative" in line for line in solution.verdict)


def test_survives_the_file(tmp_path) -> None:
    """Oracle: the record itself; a file from before alternatives were listed has none."""
    solution = solved("pinhole", AHEAD, free=False)
    save_solution(tmp_path / "solution.json", solution)
    assert load_solution(tmp_path).alternatives == solution.alternatives != []
    text = solution.model_dump_json(by_alias=True, exclude={"alternatives"})
    (tmp_path / "solution.json").write_text(text, encoding="utf-8")
    assert load_solution(tmp_path).alternatives == []

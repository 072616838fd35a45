"""Alternatives to a calibration. Oracle: the homography of the true plane, and the truth.

A pose (R, t) explains a plane with homography H exactly if s H - R = t n^T for some scale s and
some vector n: a matrix of rank one whose columns are parallel to t.
"""

import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.initialisation.alternative_poses import AlternativePose, alternative_poses
from mitsuba_endo.initialisation.correspondences import gather
from tests.rigs import Surface, bumpy_sheet, cast, lopsided_camera, plane, with_noise

SIZE, CENTRE, FOCAL, NOISE = (512, 400), (250.0, 205.0), 500.0, 0.3
NORMAL, DISTANCE = (0.3, -0.2, 1.0), 70.0
PROJECTION_MODELS = ["pinhole", "direction_cosine"]
AHEAD = RigidTransform.of([0.1, -0.05, 0.02], [-1.5, 0.8, 5.5])
"""Along the optical axis: both poses of a plane keep it in front."""
BESIDE = RigidTransform.of([0.05, -0.12, 0.03], [-6.2, 0.8, 0.9])
"""The other pose of a plane puts it behind a device."""


def found(
    law: str, surface: Surface, pose: RigidTransform, *, free: bool = False
) -> list[AlternativePose]:
    rig = cast(lopsided_camera(), projector_model(law, FOCAL, CENTRE), SIZE, pose, surface)
    rig = with_noise(rig, NOISE, 0)
    data = gather(rig.q, np.isfinite(rig.q[..., 0]), rig.camera)
    return alternative_poses(
        data, rig.projector, pose, refine_focal=free, noise_px=NOISE, width=rig.camera.width
    )


def misfit(alternative: RigidTransform, true: RigidTransform) -> float:
    """Distance of a pose from the set of those that explain the true plane, relative to H."""
    n = np.array(NORMAL)
    H = true.R + np.outer(true.t, n) / (n[2] * DISTANCE)
    # Rows across t hold no n: there s H and R must agree.
    across = np.linalg.svd(alternative.t[None])[2][1:]
    a, b = (across @ H).ravel(), (across @ alternative.R).ravel()
    s = a @ b / (a @ a)
    return float(np.linalg.norm(s * a - b) / np.linalg.norm(b))


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_other_pose_of_a_plane(law: str) -> None:
    """It explains the true plane, is not the truth, and noise cannot decide."""
    (twin,) = found(law, plane(NORMAL, DISTANCE), AHEAD)
    pose = twin.projector_from_camera
    assert misfit(pose, AHEAD) < 1e-3
    assert misfit(BESIDE, AHEAD) > 0.05, "the measure tells poses apart"
    assert rotation_angle(pose.R @ AHEAD.R.T) > np.radians(2)
    assert twin.planar
    assert not twin.decided
    assert twin.focal == FOCAL


def test_free_focal_length() -> None:
    """Directions cosines fix the focal length on a plane, for the twin as well."""
    (twin,) = found("direction_cosine", plane(NORMAL, DISTANCE), AHEAD, free=True)
    assert misfit(twin.projector_from_camera, AHEAD) < 2e-3
    assert twin.focal == pytest.approx(FOCAL, rel=0.005)


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_depth_rejects_the_twin(law: str) -> None:
    """Oracle: with a sideways baseline the other pose puts the plane behind the projector."""
    assert found(law, plane(NORMAL, DISTANCE), BESIDE) == []


@pytest.mark.parametrize("pose", [AHEAD, BESIDE])
def test_relief_has_no_alternatives(pose: RigidTransform) -> None:
    """Oracle: relief of 5 mm determines the pose."""
    assert found("pinhole", bumpy_sheet(DISTANCE, (0.2, -0.1), 5, 3), pose, free=True) == []

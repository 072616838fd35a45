"""Proposals of pose and focal length."""

import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.correspondences import gather, spread_sample
from mitsuba_endo.initialisation.epipolar_residual import bearings, residuals
from mitsuba_endo.initialisation.relative_pose_ransac import (
    distinct,
    facing,
    planar_poses,
    propose,
    same_pose,
)
from tests.rigs import cast, lopsided_camera, plane, random_rig, with_noise


def _sample(rig, count=500):
    data = gather(rig.q, np.isfinite(rig.q[..., 0]), rig.camera)
    return spread_sample(data, count, rig.camera.width, np.random.default_rng(0))


def _unit(pose):
    return RigidTransform(pose.R, pose.t / np.linalg.norm(pose.t))


@pytest.mark.parametrize("seed", [0, 1, 5])
def test_the_right_focal_length_proposes_the_right_pose(seed):
    """Oracle: the rig's pose. Proposals of minimal samples under noise are good to degrees."""
    rig = with_noise(random_rig(seed), 0.3, seed)
    best = propose(_sample(rig), rig.projector, np.array([rig.projector.focal]))[0]
    assert same_pose(best.pose, _unit(rig.projector_from_camera), 0.15)


def test_a_plane_proposes_both_twins():
    """Oracle: the true pose is among the homography's; its twin fits every correspondence too."""
    pose = RigidTransform.of([0.1, -0.05, 0.02], [-1.5, 0.8, 5.5])
    rig = cast(
        lopsided_camera(), projector_model("pinhole", 500.0, (250.0, 205.0)), (512, 400),
        pose, plane((0.3, -0.2, 1.0), 70.0),
    )  # fmt: skip
    data = _sample(rig)
    seen = bearings(rig.projector, data.q)
    poses = [facing(p, data, seen, 1e-6)[0] for p in planar_poses(data, seen, 1e-2)]
    fits = [p for p in poses if np.abs(residuals(p, data.rays, seen).r).max() < 1e-3]
    assert any(same_pose(p, _unit(pose), 1e-4) for p in fits)
    assert any(not same_pose(p, _unit(pose), 0.01) for p in fits)


def test_distinct_drops_repeats_only():
    """Oracle: three proposals, of which two differ by a hundredth of a degree."""
    rig = random_rig(0)
    base = propose(_sample(rig), rig.projector, np.array([rig.projector.focal]))[0]
    near = type(base)(base.pose.perturbed(np.array([2e-4, 0, 0, 0, 0, 0])), base.focal, base.score)
    far = type(base)(base.pose, base.focal * 1.5, base.score)
    assert distinct([base, near, far], 5) == [base, far]
    assert distinct([base, near, far], 1) == [base]

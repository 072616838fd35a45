"""Depth from a known calibration."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.correspondences import gather
from mitsuba_endo.initialisation.epipolar_refinement import evaluate
from mitsuba_endo.initialisation.triangulate import in_front, ranges, smooth_depth
from tests.rigs import random_rig, with_noise


@pytest.fixture(scope="module", params=[0, 1])
def rig(request):
    return random_rig(request.param)


def _state(rig, pose):
    data = gather(rig.q, np.isfinite(rig.q[..., 0]), rig.camera)
    return data, evaluate(pose, rig.projector, data)


def test_ranges_are_those_of_the_cast_rays(rig):
    """Oracle: the ranges at which the rays met the surface, and their distance to the projector."""
    data, state = _state(rig, rig.projector_from_camera)
    camera, projector, _ = ranges(state.pose, state.bearings, state.at)
    depth = rig.depth.flat[data.pixel]
    np.testing.assert_allclose(camera, depth, rtol=1e-8)
    points = rig.projector_from_camera.apply((depth * data.rays).T)
    np.testing.assert_allclose(projector, np.linalg.norm(points, axis=1), rtol=1e-8)


def test_a_reversed_translation_puts_everything_behind(rig):
    """Oracle: negating t negates every depth."""
    pose = rig.projector_from_camera
    _, state = _state(rig, RigidTransform(pose.R, -pose.t))
    assert (in_front(state.pose, state.bearings, state.at, 1e-6) == -1).mean() > 0.999
    assert (in_front(state.pose, state.bearings, state.at, 4.0) == 0).all()


def test_smoothing_reduces_noise_and_keeps_gaps(rig):
    """Oracle: the exact depth; the median of 25 has a third of the noise away from the rim."""
    data, state = _state(with_noise(rig, 0.3, 0), rig.projector_from_camera)
    noisy = np.full(rig.depth.shape, np.nan)
    noisy.flat[data.pixel] = ranges(state.pose, state.bearings, state.at)[0]
    smooth = smooth_depth(noisy)
    np.testing.assert_array_equal(np.isnan(smooth), np.isnan(noisy))
    before, after = (np.nanmedian(np.abs(d / rig.depth - 1)) for d in (noisy, smooth))
    assert after < 0.45 * before


def test_smoothing_nothing_gives_nothing():
    """Oracle: an empty depth map has no median."""
    assert np.isnan(smooth_depth(np.full((5, 6), np.nan))).all()

"""Errors of focal length and pose against closed forms."""

import numpy as np
import pytest

from mitsuba_endo.evaluate.metric_value import Metric, rms
from mitsuba_endo.evaluate.poses import (
    baseline_error,
    camera_errors,
    focal_error,
    rotation_error,
    translation_direction_error,
)
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.solution import Estimate, PoseEstimate

TRUTH = RigidTransform.of([0.2, -0.1, 0.3], [-6.0, 1.5, 0.5])


def _estimate(pose: RigidTransform) -> PoseEstimate:
    return PoseEstimate.of(pose)


def test_focal_is_signed_percent():
    """Oracle: 297 is 1 % less than 300."""
    found = focal_error(
        Estimate(value=297.0, status="measured"), Estimate(value=300.0, status="fixed")
    )
    assert found.value == pytest.approx(-1.0)


@pytest.mark.parametrize("side", [0, 1])
def test_unknown_focal(side: int):
    """Oracle: null, with the side and its own reason."""
    pair = [Estimate(value=300.0, status="measured")] * 2
    pair[side] = Estimate(value=None, status="unobservable", reason="a plane")
    found = focal_error(*pair)
    assert found.value is None
    assert found.reason == f"the {('solution', 'truth')[side]}'s focal length is null (a plane)"


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 0.25, 90.0, 179.0])
def test_rotation(degrees: float):
    """Oracle: the angle by which the truth was turned, about an oblique axis, either way round."""
    axis = np.array([2, -3, 6]) / 7
    turned = RigidTransform.of(np.radians(degrees) * axis, np.zeros(3)) @ TRUTH
    for pair in ((turned, TRUTH), (TRUTH, turned)):
        found = rotation_error(*map(_estimate, pair)).value
        assert found == pytest.approx(degrees, rel=1e-6, abs=1e-10)


def test_translation_direction_and_baseline():
    """Oracle: t turned by 2 degrees and stretched by 3 % shows as just that."""
    axis = np.cross(TRUTH.t, [0.3, 1, 2])
    axis /= np.linalg.norm(axis)
    t = 1.03 * RigidTransform.of(np.radians(2) * axis, np.zeros(3)).R @ TRUTH.t
    pair = _estimate(RigidTransform(TRUTH.R, t)), _estimate(TRUTH)
    assert translation_direction_error(*pair).value == pytest.approx(2.0)
    assert baseline_error(*pair).value == pytest.approx(3.0)
    assert baseline_error(*pair[::-1]).value == pytest.approx(100 * (1 / 1.03 - 1))


def test_no_baseline():
    """Oracle: a zero vector has no direction and no relative error."""
    none = _estimate(RigidTransform(TRUTH.R, np.zeros(3)))
    assert translation_direction_error(_estimate(TRUTH), none).value is None
    assert baseline_error(_estimate(TRUTH), none).value is None


def test_unknown_pose():
    """Oracle: null and the reason, for every figure that needs the pose."""
    unknown = PoseEstimate(R=None, t=None, status="unobservable", reason="no parallax")
    for function in (rotation_error, translation_direction_error, baseline_error):
        found = function(unknown, _estimate(TRUTH))
        assert found == Metric(None, "the solution's pose is null (no parallax)")
    known = _estimate(TRUTH)
    assert camera_errors((known, unknown), (known, known))[0].value is None


def test_camera_motion_does_not_depend_on_the_world():
    """Oracle: the error put into the motion; the two sides' worlds differ by a rigid motion."""
    first, second = TRUTH, TRUTH @ RigidTransform.of([0.1, 0.3, -0.2], [10, 2, -4])
    error = RigidTransform.of([0, np.radians(0.5), 0], [0.3, 0, 0.4])
    other_world = RigidTransform.of([1, 2, 0.5], [100, 50, -20])
    wrong = first @ (first.inverse() @ second @ RigidTransform.of(error.R, np.zeros(3)))
    moved = RigidTransform(wrong.R, wrong.t + first.rotate(error.t))
    turned_by, moved_by = camera_errors(
        (_estimate(other_world @ first), _estimate(other_world @ moved)),
        (_estimate(first), _estimate(second)),
    )
    assert turned_by.value == pytest.approx(0.5, rel=1e-6)
    assert moved_by.value == pytest.approx(0.5)


def test_rms_over_frames():
    """Oracle: sqrt((3^2 + 4^2) / 2), signs lost; missing frames are named."""
    names = ["a", "b", "c"]
    assert rms([Metric(3.0), Metric(-4.0)], names[:2]) == Metric(np.sqrt(12.5))
    partly = rms([Metric(3.0), Metric(None, "dark"), Metric(-4.0)], names)
    assert partly == Metric(np.sqrt(12.5), "over 2 of 3 frames (frame b: dark)")
    assert rms([Metric(None, "dark")], ["a"]) == Metric(None, "frame a: dark")

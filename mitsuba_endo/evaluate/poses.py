"""Errors of focal lengths and poses."""

import numpy as np

from ..geometry.transforms import RigidTransform, angle_between, rotation_angle
from ..records.solution import Estimate, PoseEstimate
from .metric_value import Metric


def focal_error(solution: Estimate, truth: Estimate) -> Metric:
    """Return 100 (f / f_truth - 1), percent, signed."""
    for side, estimate in (("solution", solution), ("truth", truth)):
        if not isinstance(estimate.value, float | int):
            return Metric.unknown(_null(f"the {side}'s focal length", estimate.reason))
    assert isinstance(solution.value, float | int)
    assert isinstance(truth.value, float | int)
    return Metric(100 * (solution.value / truth.value - 1))


def rotation_error(solution: PoseEstimate, truth: PoseEstimate) -> Metric:
    """Return the angle of R_solution R_truth^T, degrees."""
    pair = _pair(solution, truth)
    if isinstance(pair, Metric):
        return pair
    return Metric(float(np.degrees(rotation_angle(pair[0].R @ pair[1].R.T))))


def translation_direction_error(solution: PoseEstimate, truth: PoseEstimate) -> Metric:
    """Return the angle between the two translations t of projector_from_camera, degrees."""
    pair = _pair(solution, truth)
    if isinstance(pair, Metric):
        return pair
    if not all(np.any(p.t) for p in pair):
        return Metric.unknown("a translation of zero length has no direction")
    return Metric(float(np.degrees(angle_between(pair[0].t, pair[1].t))))


def baseline_error(solution: PoseEstimate, truth: PoseEstimate) -> Metric:
    """Return 100 (|t| / |t_truth| - 1), percent, signed; both in mm."""
    pair = _pair(solution, truth)
    if isinstance(pair, Metric):
        return pair
    lengths = [float(np.linalg.norm(p.t)) for p in pair]
    if lengths[1] == 0:
        return Metric.unknown("the true baseline is zero")
    return Metric(100 * (lengths[0] / lengths[1] - 1))


def camera_errors(
    solution: tuple[PoseEstimate, PoseEstimate], truth: tuple[PoseEstimate, PoseEstimate]
) -> tuple[Metric, Metric]:
    """Compare the motion of the camera from a reference frame to another one.

    Args:
        solution: world_from_camera of the reference frame and of the other frame.
        truth: the same of the truth; its world may be another one.

    Returns:
        Angle between the two motions' rotations, degrees, and distance between their
        translations, the unit of length of both.
    """
    motions = []
    for reference, other in (solution, truth):
        pair = _pair(reference, other, ("the first camera's", "the camera's"))
        if isinstance(pair, Metric):
            return pair, pair
        motions.append(pair[0].inverse() @ pair[1])
    rotation = float(np.degrees(rotation_angle(motions[0].R @ motions[1].R.T)))
    return Metric(rotation), Metric(float(np.linalg.norm(motions[0].t - motions[1].t)))


def _pair(
    first: PoseEstimate,
    second: PoseEstimate,
    owners: tuple[str, str] = ("the solution's", "the truth's"),
) -> tuple[RigidTransform, RigidTransform] | Metric:
    transforms = first.to_transform(), second.to_transform()
    for owner, pose, transform in zip(owners, (first, second), transforms, strict=True):
        if transform is None:
            return Metric.unknown(_null(f"{owner} pose", pose.reason))
    assert transforms[0] is not None
    assert transforms[1] is not None
    return transforms[0], transforms[1]


def _null(what: str, reason: str | None) -> str:
    return f"{what} is null" + (f" ({reason})" if reason else "")

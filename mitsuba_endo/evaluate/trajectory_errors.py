"""Errors of trajectories, by the definitions that are in common use for SLAM.

J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", IROS 2012: the absolute
trajectory error compares positions after an alignment, the relative pose error motions between
frames some way apart.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..geometry.transforms import RigidTransform, rotation_angle
from .alignment import Similarity, align

Floats = NDArray[np.float64]


def trajectory_alignment(
    poses: Sequence[RigidTransform],
    true: Sequence[RigidTransform],
    alignment: Literal["none", "rigid", "similarity"],
) -> Similarity:
    """Return what takes the found positions to the true ones best, after Umeyama.

    Args:
        poses: world_from_camera of every frame.
        true: the same of the truth, whose world may be another one.
        alignment: nothing, a rigid motion, or one with a scale.

    Raises:
        ValueError: fewer than three poses where there is something to align.
    """
    if alignment == "none":
        return Similarity.identity()
    return align(_positions(poses), _positions(true), scale=alignment == "similarity")


def absolute_trajectory_error(
    poses: Sequence[RigidTransform], true: Sequence[RigidTransform], by: Similarity
) -> Floats:
    """Return the distance (N,) of every position from the true one after an alignment."""
    return np.linalg.norm(by.apply(_positions(poses)) - _positions(true), axis=1)


def relative_pose_error(
    poses: Sequence[RigidTransform], true: Sequence[RigidTransform], apart: int = 1
) -> tuple[Floats, Floats]:
    """Return errors of the motions between frames that are ``apart`` frames apart.

    The error is (Q_i^-1 Q_j)^-1 (P_i^-1 P_j) with P found and Q true; no alignment enters.

    Returns:
        Lengths of the errors' translations, the unit of length, and their angles, radians; (N,).
    """
    shift, turn = [], []
    for i in range(len(poses) - apart):
        motion = poses[i].inverse() @ poses[i + apart]
        wanted = true[i].inverse() @ true[i + apart]
        error = wanted.inverse() @ motion
        shift.append(np.linalg.norm(error.t))
        turn.append(rotation_angle(error.R))
    return np.array(shift), np.array(turn)


def _positions(poses: Sequence[RigidTransform]) -> Floats:
    return np.array([pose.t for pose in poses])

"""Trajectory errors, on trajectories whose errors are known."""

import numpy as np
import pytest

from mitsuba_endo.evaluate.trajectory_errors import (
    absolute_trajectory_error,
    relative_pose_error,
    trajectory_alignment,
)
from mitsuba_endo.geometry.transforms import RigidTransform

RNG = np.random.default_rng(3)
TRUE = [RigidTransform.of(RNG.normal(0, 0.3, 3), RNG.normal(0, 20, 3)) for _ in range(9)]
ELSEWHERE = RigidTransform.of([0.3, -0.2, 0.9], [30.0, -5.0, 12.0])


def _error(found: list[RigidTransform], how: str) -> np.ndarray:
    by = trajectory_alignment(found, TRUE, how)  # pyright: ignore[reportArgumentType]
    return absolute_trajectory_error(found, TRUE, by)


def test_another_world_is_no_error_after_alignment() -> None:
    """Oracle: a rigid motion of the world changes no trajectory."""
    found = [ELSEWHERE @ pose for pose in TRUE]
    assert _error(found, "rigid") == pytest.approx(0, abs=1e-9)
    assert _error(found, "none") == pytest.approx(
        [np.linalg.norm(ELSEWHERE.apply(p.t) - p.t) for p in TRUE]
    )


def test_scale_is_an_error_unless_it_is_free() -> None:
    """Oracle: positions about their centre, times what the scale is off by."""
    found = [RigidTransform(p.R, 1.1 * p.t) for p in TRUE]
    positions = np.array([p.t for p in TRUE])
    assert trajectory_alignment(found, TRUE, "similarity").scale == pytest.approx(1 / 1.1)
    assert _error(found, "similarity") == pytest.approx(0, abs=1e-9)
    spread = np.linalg.norm(positions - positions.mean(0), axis=1)
    assert _error(found, "rigid") == pytest.approx(0.1 * spread)


def test_relative_error_of_one_step() -> None:
    """Oracle: one pose turned and moved in its own axes: both motions at it show that, once."""
    off = RigidTransform.of([0.0, 0.02, 0.0], [0.3, 0.0, 0.4])
    found = [ELSEWHERE @ pose for pose in TRUE]
    found[4] = found[4] @ off
    shift, turn = relative_pose_error(found, TRUE)
    assert turn == pytest.approx([0, 0, 0, 0.02, 0.02, 0, 0, 0], abs=1e-9)
    assert shift[3] == pytest.approx(0.5)
    assert np.count_nonzero(shift > 1e-9) == 2
    assert len(relative_pose_error(found, TRUE, 3)[0]) == 6

"""The random walk of a map."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.sequence.linearise import Poses
from mitsuba_endo.sequence.map_drift import MapDrift, in_world

PROJECTOR = RigidTransform.of([0.0, 0.1, 0.0], [-5.0, 0.0, 0.0])


def _poses(z: float) -> Poses:
    return Poses(RigidTransform.of([0.0, 0.0, 0.0], [0.0, 0.0, z]), PROJECTOR)


def test_a_rotation_is_felt_as_a_shift_far_away() -> None:
    """Oracle: w x t: 0.01 rad about x shifts what lies 100 mm along z by 1 mm along y."""
    drift, own = MapDrift(), np.zeros((12, 12))
    own[6, 6] = 0.01**2
    drift.fused(_poses(0.0), own, 10.0)
    at = drift.at(RigidTransform.of([0.0, 0.0, 0.0], [0.0, 0.0, 100.0]))
    # The first frame's error counts whole, and this one's by a half: two cameras are near.
    assert np.sqrt(at[10, 10]) == pytest.approx(1.0 * np.sqrt(1 + 1 / 4))
    assert at[9, 9] == pytest.approx(0)


def test_an_error_of_the_baseline_grows_with_the_way() -> None:
    """Oracle: 1 % of the baseline is 1 % of 40 mm."""
    drift, own = MapDrift(), np.zeros((12, 12))
    own[3, 3] = 0.05**2
    drift.fused(_poses(0.0), own, 1e-9)
    drift.fused(_poses(-40.0), np.zeros((12, 12)), 1e-9)
    first = 0.05 * np.sqrt(1 + 1 / 2**2)
    assert np.sqrt(drift.at(_poses(-40.0).world_from_camera)[11, 11]) == pytest.approx(
        0.4 * first / 0.05
    )


def test_many_frames_of_one_place_move_the_map_little() -> None:
    """Oracle: sum of 1 / n^2, which is below 1.65, over frames that see the same place."""
    drift, own = MapDrift(), np.eye(12)
    for _ in range(200):
        drift.fused(_poses(0.0), own, 1.0)
    assert 1.6 < drift.at(RigidTransform.identity())[8, 8] < 1.65


def test_steps_turn_into_the_worlds_axes() -> None:
    """Oracle: a quarter turn about z takes x to y."""
    quarter = RigidTransform.of([0.0, 0.0, np.pi / 2], [3.0, 4.0, 5.0])
    own = np.diag([1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12])
    turned = np.diag(in_world(own, quarter))
    assert turned == pytest.approx([1, 2, 3, 4, 5, 6, 8, 7, 9, 11, 10, 12])

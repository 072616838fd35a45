"""The random walk of a map, and how it bends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsuba_endo.fusion import RangeFrame, Volume
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.sequence.error_propagation import camera_by_projector
from mitsuba_endo.sequence.linearise import Poses, against_map, triangulate
from mitsuba_endo.sequence.map_drift import MapDrift, in_world
from mitsuba_endo.sequence.placement import Prior, place
from mitsuba_endo.sequence.view import view_of
from tests.sequences import exact, withdrawal

NOTHING = np.zeros((6, 6))


def _at(z: float) -> RigidTransform:
    return RigidTransform.of([0.0, 0.0, 0.0], [0.0, 0.0, z])


def test_a_rotation_is_felt_as_a_shift_far_away() -> None:
    """Oracle: w x t: 0.01 rad about x shifts what lies 100 mm along z by 1 mm along y."""
    drift, own = MapDrift(NOTHING), np.zeros((12, 12))
    own[6, 6] = 0.01**2
    drift.fused(_at(0.0), own, NOTHING, 10.0)
    at = drift.at(_at(100.0))
    # The first frame's error counts whole, and this one's by a half: two cameras are near.
    assert np.sqrt(at[10, 10]) == pytest.approx(1.0 * np.sqrt(1 + 1 / 4))
    assert at[9, 9] == pytest.approx(0)


def test_an_error_of_the_first_projector_grows_with_the_way() -> None:
    """Oracle: 1 % of the baseline is 1 % of 40 mm."""
    first, bent = np.zeros((6, 6)), np.zeros((6, 6))
    first[3, 3] = 0.05**2
    bent[5, 3] = -40.0 / 5.0  # shift along z for an error of a baseline of 5 mm along x
    drift = MapDrift(first)
    drift.fused(_at(0.0), np.zeros((12, 12)), NOTHING, 1.0)
    drift.fused(_at(-40.0), np.zeros((12, 12)), bent, 1.0)
    known = drift.at(_at(-40.0))
    assert np.sqrt(known[11, 11]) == pytest.approx(0.4)
    assert np.sqrt(known[3, 3]) == pytest.approx(0.05)


def test_many_frames_of_one_place_move_the_map_little() -> None:
    """Oracle: sum of 1 / n^2, which is below 1.65, over frames that see the same place."""
    drift, own = MapDrift(NOTHING), np.eye(12)
    for _ in range(200):
        drift.fused(_at(0.0), own, NOTHING, 1.0)
    assert 1.6 < drift.at(RigidTransform.identity())[8, 8] < 1.65


def test_steps_turn_into_the_worlds_axes() -> None:
    """Oracle: a quarter turn about z takes x to y."""
    quarter = RigidTransform.of([0.0, 0.0, np.pi / 2], [3.0, 4.0, 5.0])
    own = np.diag([1.0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12])
    turned = np.diag(in_world(own, quarter))
    assert turned == pytest.approx([1, 2, 3, 4, 5, 6, 8, 7, 9, 11, 10, 12])


def test_bending_is_what_a_wrong_projector_does() -> None:
    """Oracle: a map made with a wrong pose of the projector, on which a later frame is placed with
    the same wrong pose: by how much the wall seems to have moved, point by point."""
    clean = withdrawal(20, noise=exact)
    off = np.array([0, 0, 0.0, 0, 0, 0.1])  # the projector 0.1 mm too far in its channel
    wrong = clean.projector_from_camera[0].perturbed(off)
    first, last = (view_of(clean.map(k), clean.camera, 1) for k in (0, 19))
    volume = Volume(0.5)
    at = np.flatnonzero(first.usable)
    sample = first.correspondences(clean.projector, at)
    ranges = np.full(first.usable.shape, np.nan)
    ranges.ravel()[at] = triangulate(sample, clean.projector, wrong).range
    volume.integrate(RangeFrame(ranges, clean.camera, RigidTransform.identity()))
    same = clean.projector_from_camera[19].perturbed(off)
    held = Prior(same, np.eye(6) * 1e12)
    true = Poses(clean.world_from_camera[19], same)
    sample = last.sample(clean.projector)
    found = place(sample, true, clean.projector, volume, held, 0.1)
    moved = true.world_from_camera.inverse() @ found.poses.world_from_camera
    bent = camera_by_projector(
        sample, found.triangulated, found.poses, clean.world_from_camera[0], clean.projector, volume
    )
    step = np.concatenate([Rotation.from_matrix(moved.R).as_rotvec(), moved.t])
    seen = against_map(sample, found.triangulated, found.poses.world_from_camera, volume)
    felt, wanted = (seen.by_poses[6:, seen.observed].T @ s for s in (step, bent @ off))
    # Directions in which the tube hardly holds a camera are free in both: the wall decides.
    assert np.corrcoef(felt, wanted)[0, 1] > 0.8
    assert np.std(felt - wanted) < 0.6 * np.std(felt)

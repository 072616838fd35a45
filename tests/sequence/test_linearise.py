"""Derivatives against finite differences, and what exact maps say of true poses."""

import numpy as np
import pytest

from mitsuba_endo.fusion import RangeFrame, Volume
from mitsuba_endo.geometry.transforms import rotation_angle
from mitsuba_endo.sequence.linearise import Poses, against_map, triangulate
from mitsuba_endo.sequence.placement import Placement, Prior, place
from mitsuba_endo.sequence.view import PixelSample, ThinnedMap, thinned, thinning, view_of
from tests.lumen import endoscope
from tests.sequences import Recording, exact, withdrawal

NOWHERE = np.zeros((6, 6))


@pytest.fixture(scope="module")
def clean() -> Recording:
    return withdrawal(12, noise=exact)


@pytest.fixture(scope="module")
def volume(clean: Recording) -> Volume:
    """The map that exact ranges make from true poses."""
    volume = Volume(0.5)
    for k in range(0, 10, 2):
        q, points = clean.exact(k)
        ranges = np.where(np.isfinite(q[..., 0]), np.linalg.norm(points, axis=-1), np.nan)
        volume.integrate(RangeFrame(ranges, clean.camera, clean.world_from_camera[k]))
    return volume


def _view(clean: Recording, k: int) -> ThinnedMap:
    return view_of(clean.map(k), clean.camera, 1)


def _true(clean: Recording, k: int) -> Poses:
    return Poses(clean.world_from_camera[k], clean.projector_from_camera[k])


def test_exact_maps_triangulate_to_their_points(clean: Recording) -> None:
    """Oracle: the scene's ranges; maps are in single precision."""
    view = _view(clean, 3)
    at = np.flatnonzero(view.usable)
    found = triangulate(
        view.correspondences(clean.projector, at), clean.projector, clean.projector_from_camera[3]
    )
    true = np.linalg.norm(clean.exact(3)[1], axis=-1).ravel()[at]
    assert found.good.all()
    assert np.abs(found.across).max() < 1e-3
    assert np.median(np.abs(found.range - true)) < 1e-3


def test_derivatives_of_lines_and_ranges(clean: Recording) -> None:
    """Oracle: central differences, also by the log of the focal length."""
    sample, pose = _view(clean, 3).sample(clean.projector, 500), clean.projector_from_camera[3]
    found = triangulate(sample, clean.projector, pose)
    h = 1e-5
    for j in range(6):
        step = np.eye(6)[j] * h
        ahead, behind = (
            triangulate(sample, clean.projector, pose.perturbed(s)) for s in (step, -step)
        )
        across = (behind.across - ahead.across) / (2 * h)
        ranges = (ahead.range - behind.range) / (2 * h)
        assert across == pytest.approx(found.by_pose[j], rel=1e-3, abs=0.05)
        assert ranges == pytest.approx(found.range_by_pose[j], rel=1e-3, abs=0.05)
    ends = []
    for sign in (1, -1):
        model = clean.projector.with_(focal=clean.projector.focal * np.exp(sign * h))
        again = PixelSample(
            sample.rays, sample.q, _view(clean, 3).sample(model, 500).bearings, sample.block
        )
        ends.append(triangulate(again, model, pose).across)
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(found.by_pose[6], rel=1e-3, abs=0.05)


def test_derivatives_of_distances_to_the_map(clean: Recording, volume: Volume) -> None:
    """Oracle: central differences over a tenth of a voxel; the map's normals vary from place to
    place, so the mean over the points is compared."""
    sample, poses = _view(clean, 3).sample(clean.projector, 3000), _true(clean, 3)
    found = triangulate(sample, clean.projector, poses.projector_from_camera)
    seen = against_map(sample, found, poses.world_from_camera, volume)
    for j in range(12):
        h = 0.05 / np.median(np.abs(seen.by_poses[j, seen.observed]))
        ends = []
        for sign in (1, -1):
            moved = poses.moved(np.eye(12)[j] * sign * h)
            again = triangulate(sample, clean.projector, moved.projector_from_camera)
            ends.append(against_map(sample, again, moved.world_from_camera, volume))
        both = seen.observed & ends[0].observed & ends[1].observed
        slope = (ends[0].distance - ends[1].distance)[both] / (2 * h)
        wanted = seen.by_poses[j, both]
        assert np.sum(slope * wanted) / np.sum(wanted**2) == pytest.approx(1, abs=0.03)


def _place(clean: Recording, volume: Volume, k: int, off: np.ndarray) -> Placement:
    prior = Prior(clean.projector_from_camera[k], NOWHERE)
    sample = _view(clean, k).sample(clean.projector)
    return place(sample, _true(clean, k).moved(off), clean.projector, volume, prior, 0.1)


@pytest.mark.parametrize("off", [1.0, -1.0])
def test_a_frame_is_placed_from_two_millimetres_and_degrees_away(
    clean: Recording, volume: Volume, off: float
) -> None:
    """Oracle: the scene; what is left is the map's voxels of 0.5 mm."""
    start = off * np.array([0.003, -0.003, 0.003, 0.1, 0.1, -0.1, 0.03, -0.02, 0.02, 1, 1, -1])
    found = _place(clean, volume, 5, start)
    pose, true = found.poses.world_from_camera, clean.world_from_camera[5]
    assert found.settled
    assert found.agreement > 0.97
    assert np.linalg.norm(pose.t - true.t) < 0.1
    assert np.degrees(rotation_angle(pose.R @ true.R.T)) < 0.2
    own, lit = found.poses.projector_from_camera, clean.projector_from_camera[5]
    assert np.degrees(rotation_angle(own.R @ lit.R.T)) < 0.02


def test_a_wrong_place_is_seen_to_be_wrong(clean: Recording, volume: Volume) -> None:
    """Twelve millimetres along the tube there are other folds."""
    from mitsuba_endo.sequence.gate import fault

    start = np.zeros(12)
    start[11] = 12.0
    assert fault(_place(clean, volume, 5, np.zeros(12))) == ""
    assert fault(_place(clean, volume, 5, start)) != ""


def test_where_no_map_is_known_the_camera_stays(clean: Recording) -> None:
    found = _place(clean, Volume(0.5), 5, np.array([0.005, 0, 0.005, 0, 0.1, 0, *[0] * 6]))
    assert found.overlap == 0
    moved = found.poses.world_from_camera.t - clean.world_from_camera[5].t
    assert np.linalg.norm(moved) < 1e-6
    own, true = found.poses.projector_from_camera, clean.projector_from_camera[5]
    assert np.degrees(rotation_angle(own.R @ true.R.T)) < 0.01


def test_thinned_cameras_see_the_same_rays() -> None:
    """Oracle: every third ray of the full camera; the sides are no multiples of three."""
    full = endoscope(1201, 905)
    step = thinning(full)
    small = thinned(full, step)
    assert step > 3
    assert small.grid_rays == pytest.approx(full.grid_rays[::step, ::step], abs=1e-12)

"""Frusta and rays in the first camera's frame."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import Estimate, PoseEstimate
from mitsuba_endo.show.frame_poses import (
    correspondence_rays,
    frame_poses,
    pyramid,
    solution_corners,
)

Maker = Callable[..., Calibration]


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return make_calibration(width=120, height=90, count=2)


def test_rays_meet_on_the_surface(calibration: Calibration):
    """Oracle: rendered maps without noise: both rays end at one point of the sheet, and start at
    the second frame's camera and projector."""
    maps = replace(calibration.frames[1], observed=calibration.frames[1].rendered)
    at = frame_poses(calibration.solution)[1]
    rays = correspondence_rays(calibration.solution, calibration.camera, maps, at, 60)
    assert rays is not None
    assert 40 < len(rays.pixels) < 130
    assert maps.used[rays.pixels[:, 1], rays.pixels[:, 0]].all()
    spread = np.ptp(rays.pixels, axis=0)
    assert (spread > [80, 60]).all()
    np.testing.assert_allclose(rays.camera[:, 1], rays.projector[:, 1], atol=2e-3)
    surface = calibration.surface
    assert distance_to_mesh(rays.camera[:, 1], surface.vertices, surface.faces).max() < 5e-3
    first, second = (f.world_from_camera.to_transform() for f in calibration.solution.frames)
    pose = calibration.solution.frames[1].projector_from_camera.to_transform()
    assert first is not None
    assert second is not None
    assert pose is not None
    camera = first.R.T @ (second.t - first.t)
    centre = first.R.T @ (second.R @ (-pose.R.T @ pose.t) + second.t - first.t)
    np.testing.assert_allclose(rays.camera[:, 0], np.tile(camera, (len(rays.camera), 1)))
    np.testing.assert_allclose(rays.projector[:, 0], np.tile(centre, (len(rays.camera), 1)))


def test_noise_is_the_gap_of_the_rays(calibration: Calibration):
    """Oracle: q shifted across the epipolar lines by 3 px moves the projector's ray by that."""
    maps = calibration.frames[0]
    at = frame_poses(calibration.solution)[0]
    shifted = replace(maps, observed=maps.rendered + np.array([0, 3.0], np.float32))
    rays = correspondence_rays(calibration.solution, calibration.camera, shifted, at, 60)
    assert rays is not None
    gap = np.linalg.norm(rays.camera[:, 1] - rays.projector[:, 1], axis=1)
    far = np.linalg.norm(rays.projector[:, 1] - rays.projector[:, 0], axis=1)
    assert np.median(gap / far) == pytest.approx(3 / 900, rel=0.25)


def test_unknown_places_have_no_rays(calibration: Calibration):
    """Oracle: a pose or a focal length that is null; a frustum is then its axis."""
    unknown = PoseEstimate(R=None, t=None, status="unobservable", reason="one plane")
    frame = calibration.solution.frames[0].model_copy(update={"projector_from_camera": unknown})
    solution = calibration.solution.model_copy(
        update={"frames": [frame, *calibration.solution.frames[1:]]}
    )
    at = frame_poses(solution)[0]
    assert at.first_from_camera is not None
    assert at.first_from_projector is None
    maps, camera = calibration.frames[0], calibration.camera
    assert correspondence_rays(solution, camera, maps, at, 60) is None
    focal = Estimate(value=None, status="unobservable", reason="one plane")
    projector = calibration.solution.projector.model_copy(update={"focal": focal})
    solution = calibration.solution.model_copy(update={"projector": projector})
    assert correspondence_rays(solution, camera, maps, frame_poses(solution)[0], 60) is None
    corners = solution_corners(solution, solution.frames[0])
    np.testing.assert_array_equal(corners, [[0, 0, 1]])
    edges = pyramid(RigidTransform.of([0, 0, 0], [1, 2, 3]), corners, 5.0)
    np.testing.assert_allclose(edges[0], [[1, 2, 3], [1, 2, 8]])

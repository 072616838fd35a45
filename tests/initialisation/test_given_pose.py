"""Starts from a known pose. Oracle: the rig's truth."""

from functools import cache
from itertools import islice

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.given_pose import known_start, start_at_pose
from mitsuba_endo.initialisation.result import Start
from tests.rigs import Rig, lopsided_camera, random_rig, with_noise, with_outliers

NOISE = 0.3
"""Pattern pixels."""
CAMERA = lopsided_camera(160, 112)


@cache
def first_with(law: str, count: int) -> list[Rig]:
    """The first random rigs of a projection model."""
    rigs = (random_rig(seed, CAMERA) for seed in range(50))
    return list(islice((rig for rig in rigs if rig.projector.law == law), count))


def spoiled(rig: Rig) -> Rig:
    """The rig's view with noise and two gross errors in a hundred."""
    return with_outliers(with_noise(rig, NOISE, 0), 0.02, 1)


def started(rig: Rig, pose: RigidTransform) -> Start:
    return start_at_pose(rig.q, rig.camera, rig.unknown_projector, pose, rig.size)


@pytest.mark.parametrize("law", ["pinhole", "direction_cosine"])
@pytest.mark.parametrize("which", range(4))
def test_focal_length_at_the_true_pose(law: str, which: int) -> None:
    """Oracle: the true focal length to 1 %, and the ranges that the rays were cast to."""
    rig = first_with(law, 4)[which]
    found = started(spoiled(rig), rig.projector_from_camera)
    assert found.projector.focal == pytest.approx(rig.projector.focal, rel=0.01)
    np.testing.assert_array_equal(found.projector_from_camera.R, rig.projector_from_camera.R)
    np.testing.assert_allclose(
        found.projector_from_camera.t, rig.projector_from_camera.t / rig.baseline
    )
    seen = found.used & np.isfinite(rig.depth)
    assert seen.sum() > 0.9 * np.isfinite(rig.depth).sum()
    ratio = found.depth[seen] * rig.baseline / rig.depth[seen]
    assert np.median(ratio) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("law", ["pinhole", "direction_cosine"])
def test_focal_length_at_a_rough_pose(law: str) -> None:
    """Oracle: as good as a search's start: a degree off, the focal length within a tenth."""
    (rig,) = first_with(law, 1)
    off = rig.projector_from_camera.perturbed(np.array([0.01, -0.01, 0.005, 0, 0, 0]))
    found = started(spoiled(rig), off)
    assert found.projector.focal == pytest.approx(rig.projector.focal, rel=0.1)


def test_unit_of_the_pose_does_not_matter() -> None:
    """Oracle: the same pose in metres."""
    (rig,) = first_with("pinhole", 1)
    pose = rig.projector_from_camera
    one, other = (started(rig, p) for p in (pose, RigidTransform(pose.R, pose.t / 1000)))
    assert one.projector.focal == pytest.approx(other.projector.focal, rel=1e-9)
    np.testing.assert_allclose(one.depth, other.depth, rtol=1e-9)


def test_is_the_known_start_at_the_focal_length_found() -> None:
    """Oracle: the start from a whole calibration."""
    (rig,) = first_with("direction_cosine", 1)
    noisy = spoiled(rig)
    found = started(noisy, rig.projector_from_camera)
    known = known_start(noisy.q, rig.camera, found.projector, rig.projector_from_camera)
    np.testing.assert_array_equal(found.depth, known.depth)
    np.testing.assert_array_equal(found.used, known.used)


def test_too_few_correspondences() -> None:
    """Oracle: an error in one sentence, not a focal length of nothing."""
    (rig,) = first_with("pinhole", 1)
    empty = np.full_like(rig.q, np.nan)
    with pytest.raises(InputError):
        start_at_pose(empty, rig.camera, rig.unknown_projector, rig.projector_from_camera, rig.size)

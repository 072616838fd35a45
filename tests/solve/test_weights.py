"""Calibration from coordinates that are known unequally well."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import rotation_from_vector
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.frames.weights import balanced
from mitsuba_endo.solve.options import Options
from tests.rigs import Rig, with_noise
from tests.solve.problems import map_of, rig_file, small_rig

LOW, HIGH = 0.1, 1.6
FORMAL = Options(jackknife=False, check_model=False)


def roughly(rig: Rig) -> dict[str, Any]:
    """What a rig file says of a pose that is known to a degree: no search is needed then."""
    pose = rig.projector_from_camera
    R = pose.R @ rotation_from_vector(np.radians([0.8, -0.5, 0.3]))
    return {"pose": {"R": R.tolist(), "t": pose.t.tolist()}}


def noisy(seed: int) -> CorrespondenceMap:
    """A map whose noise grows in stripes, with the weights that say so."""
    map_ = map_of(small_rig("pinhole"))
    rng = np.random.default_rng(seed)
    rough = np.arange(map_.q.shape[1]) // 12 % 2 == 1
    sigma = np.broadcast_to(np.where(rough, HIGH, LOW), map_.q.shape[:2])
    q = map_.q + sigma[..., None] * rng.standard_normal(map_.q.shape)
    return CorrespondenceMap(
        q.astype(np.float32), map_.name, ((LOW / sigma) ** 2).astype(np.float32)
    )


@pytest.mark.usefixtures("llvm")
def test_weights_sharpen_the_calibration_and_its_intervals():
    """Oracle: the true focal length, within the stated deviation; the noise that the mean weight
    stands for."""
    rig = small_rig("pinhole")
    known = rig_file(rig, projector=roughly(rig))
    errors, stds, plain = [], [], []
    for seed in range(6):
        map_ = noisy(seed)
        found = calibrate([map_], known, FORMAL)
        focal = found.solution.projector.focal
        assert isinstance(focal.value, float)
        assert isinstance(focal.std, float)
        errors.append(focal.value - rig.projector.focal)
        stds.append(focal.std)
        assert map_.weight is not None
        typical = LOW / np.sqrt(map_.weight[map_.valid].mean())
        assert found.solution.noise_px == pytest.approx(typical, rel=0.25)
        without = calibrate([replace(map_, weight=None)], known, FORMAL).solution
        assert isinstance(without.projector.focal.value, float)
        plain.append(without.projector.focal.value - rig.projector.focal)
    assert np.sqrt(np.mean(np.square(errors))) < 0.7 * np.sqrt(np.mean(np.square(plain)))
    assert 0.4 < np.sqrt(np.mean((np.array(errors) / stds) ** 2)) < 1.8


@pytest.mark.usefixtures("llvm")
def test_only_ratios_of_weights_count():
    """Oracle: the map without weights: a factor common to all of them says nothing."""
    rig = with_noise(small_rig("pinhole"), 0.3, 3)
    map_ = map_of(rig)
    alike = replace(map_, weight=np.full(map_.q.shape[:2], 0.04, np.float32))
    plain, weighted = (calibrate([m], rig_file(rig), FORMAL).solution for m in (map_, alike))
    for a, b in (
        (weighted.projector.focal.value, plain.projector.focal.value),
        (weighted.projector.focal.std, plain.projector.focal.std),
        (weighted.noise_px, plain.noise_px),
    ):
        assert a == pytest.approx(b, rel=1e-5)


def test_frames_keep_their_ratio():
    """Oracle: by hand: weights 0.5 and, where a map has none, 1; holes do not count."""
    q = np.ones((2, 3, 2), np.float32)
    q[0, 0] = np.nan
    weight = np.full((2, 3), 0.5, np.float32)
    weight[0, 0] = np.nan
    first, second = balanced([CorrespondenceMap(q, "a", weight), CorrespondenceMap(q, "b")])
    assert first.weight is not None
    assert second.weight is not None
    np.testing.assert_allclose(first.weight[first.valid], 2 / 3, rtol=1e-6)
    np.testing.assert_allclose(second.weight[second.valid], 4 / 3, rtol=1e-6)


def slanted(seed: int) -> CorrespondenceMap:
    """A map whose errors are ten times larger along an axis that turns over the image."""
    map_ = map_of(small_rig("pinhole"))
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, np.pi, map_.q.shape[1])[None, :] + np.zeros(map_.q.shape[:2])
    long = np.stack([np.cos(angle), np.sin(angle)], -1)
    across = np.stack([-np.sin(angle), np.cos(angle)], -1)
    error = HIGH * rng.standard_normal(map_.q.shape[:2])[..., None] * long
    error += HIGH / 10 * rng.standard_normal(map_.q.shape[:2])[..., None] * across
    full = HIGH**2 * (long[..., :, None] * long[..., None, :])
    full += (HIGH / 10) ** 2 * (across[..., :, None] * across[..., None, :])
    covariance = np.stack([full[..., 0, 0], full[..., 0, 1], full[..., 1, 1]], -1)
    q = (map_.q + error).astype(np.float32)
    return CorrespondenceMap(q, map_.name, covariance=covariance.astype(np.float32))


@pytest.mark.usefixtures("llvm")
def test_covariances_sharpen_the_calibration_and_its_intervals():
    """Oracle: the true focal length; an axis that is known well counts as such."""
    rig = small_rig("pinhole")
    known = rig_file(rig, projector=roughly(rig))
    errors, stds, plain = [], [], []
    for seed in range(6):
        map_ = slanted(seed)
        focal = calibrate([map_], known, FORMAL).solution.projector.focal
        blind = replace(map_, covariance=None)
        without = calibrate([blind], known, FORMAL).solution.projector.focal
        assert isinstance(focal.value, float)
        assert isinstance(focal.std, float)
        assert isinstance(without.value, float)
        errors.append(focal.value - rig.projector.focal)
        stds.append(focal.std)
        plain.append(without.value - rig.projector.focal)
    assert np.sqrt(np.mean(np.square(errors))) < 0.6 * np.sqrt(np.mean(np.square(plain)))
    assert 0.4 < np.sqrt(np.mean((np.array(errors) / stds) ** 2)) < 1.8
    assert max(stds) < 0.02 * rig.projector.focal

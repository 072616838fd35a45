"""Calibration from coordinates that are known unequally well."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.solve.problems import map_of, rig_file, small_rig

LOW, HIGH = 0.1, 1.6
FORMAL = Options(jackknife=False)


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
    """Oracle: the true focal length, within the stated deviation; the noise of the best pixels."""
    rig = small_rig("pinhole")
    errors, stds, plain = [], [], []
    for seed in range(6):
        map_ = noisy(seed)
        found = calibrate([map_], rig_file(rig), FORMAL)
        focal = found.solution.projector.focal
        assert isinstance(focal.value, float)
        assert isinstance(focal.std, float)
        errors.append(focal.value - rig.projector.focal)
        stds.append(focal.std)
        assert found.solution.noise_px == pytest.approx(LOW, rel=0.25)
        without = calibrate([replace(map_, weight=None)], rig_file(rig), FORMAL).solution
        assert isinstance(without.projector.focal.value, float)
        plain.append(without.projector.focal.value - rig.projector.focal)
    assert np.sqrt(np.mean(np.square(errors))) < 0.7 * np.sqrt(np.mean(np.square(plain)))
    assert 0.4 < np.sqrt(np.mean((np.array(errors) / stds) ** 2)) < 1.8

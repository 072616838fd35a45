"""Robust losses and the descent."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.initialisation.correspondences import gather, spread_sample
from mitsuba_endo.initialisation.epipolar_refinement import (
    EpipolarLoss,
    evaluate,
    focal_deviation,
    minimise,
)
from tests.rigs import random_rig, with_noise


@pytest.mark.parametrize("redescending", [False, True])
def test_weight_is_the_derivative_of_the_loss(redescending):
    """Oracle: rho'(r) = w(r) r by central differences; w(0) = 1."""
    loss, h = EpipolarLoss(redescending, 1.7), 1e-5
    for r in (0.2, 1.0, 4.0):
        slope = (loss.cost(np.array([r + h])) - loss.cost(np.array([r - h]))) / (2 * h)
        assert slope == pytest.approx(float(loss.weight(np.array([r]))[0]) * r, rel=1e-8)
    assert loss.weight(np.zeros(1)) == 1


def _data(seed, sigma, count=3000):
    rig = random_rig(seed)
    noisy = with_noise(rig, sigma, seed)
    data = gather(noisy.q, np.isfinite(noisy.q[..., 0]), rig.camera)
    return rig, spread_sample(data, count, rig.camera.width, np.random.default_rng(0))


def _from_truth(rig, data, focal_factor=1.0):
    truth = rig.projector_from_camera
    pose = type(truth)(truth.R, truth.t / rig.baseline).perturbed(
        np.array([0.02, -0.03, 0.01, 0, 0, 0]) * (focal_factor != 1)
    )
    return evaluate(pose, rig.projector.with_(focal=focal_factor * rig.projector.focal), data)


@pytest.mark.parametrize("seed", [0, 1])
def test_descends_to_the_truth_of_exact_data(seed):
    """Oracle: exact correspondences have their minimum at the truth."""
    rig, data = _data(seed, 0.0)
    state = _from_truth(rig, data, 1.1)
    found = minimise(state, data, EpipolarLoss(False, 20.0), refine_focal=True, iterations=100)
    assert found.projector.focal == pytest.approx(rig.projector.focal, rel=1e-4)
    assert angle_between(found.pose.t, rig.projector_from_camera.t) < 1e-3


def test_a_fixed_focal_length_stays():
    """Oracle: the value given."""
    rig, data = _data(0, 0.3)
    found = minimise(
        _from_truth(rig, data, 1.1), data, EpipolarLoss(False, 5.0), refine_focal=False
    )
    assert found.projector.focal == 1.1 * rig.projector.focal


def test_bounds_stop_the_focal_length():
    """Oracle: a bound below the minimum's focal length is not crossed."""
    rig, data = _data(0, 0.3)
    bound = (0.0, 0.95 * rig.projector.focal)
    start = evaluate(
        _from_truth(rig, data).pose, rig.projector.with_(focal=0.9 * rig.projector.focal), data
    )
    found = minimise(start, data, EpipolarLoss(False, 5.0), refine_focal=True, focal_bounds=bound)
    assert 0.9 * rig.projector.focal < found.projector.focal <= bound[1]


def test_focal_deviation_is_the_scatter_of_repeated_fits():
    """Oracle: the standard deviation of log focal over 60 noise draws, known to 9 %."""
    focals, formal = [], []
    rig = random_rig(1)
    seen = np.isfinite(rig.q[..., 0])
    for draw in range(60):
        data = gather(with_noise(rig, 0.3, draw).q, seen, rig.camera)
        data = spread_sample(data, 800, rig.camera.width, np.random.default_rng(draw))
        loss = EpipolarLoss(False, 10.0)
        found = minimise(_from_truth(rig, data), data, loss, refine_focal=True)
        focals.append(np.log(found.projector.focal))
        formal.append(focal_deviation(found, data, loss))
    assert np.mean(formal) == pytest.approx(np.std(focals), rel=0.3)

"""The focal length from epipolar lines."""

import numpy as np
import pytest

from mitsuba_endo.sequence.epipolar_focal import FocalSum, focal_of
from mitsuba_endo.sequence.view import view_of
from tests.lumen import FOCAL
from tests.sequences import exact, withdrawal


def test_exact_lines_give_the_focal_length_and_the_poses() -> None:
    """Oracle: the scene; the start is 1 % off, and so is the first pose, by half a degree."""
    clean = withdrawal(4, noise=exact)
    views = [view_of(m, clean.camera, 1) for m in clean.maps()]
    start = clean.projector_from_camera[0].perturbed(np.array([0.004, -0.004, 0.004, 0, 0, 0]))
    wrong = clean.projector.with_(focal=1.01 * FOCAL)
    found = focal_of(views, wrong, start, free=True)
    assert found.projector.focal == pytest.approx(FOCAL, rel=1e-4)
    for pose, true in zip(found.poses, clean.projector_from_camera, strict=True):
        assert pytest.approx(true.R, abs=1e-4) == pose.R
        assert np.linalg.norm(pose.t) == pytest.approx(np.linalg.norm(start.t))
    held = focal_of(views, wrong, start, free=False)
    assert held.projector.focal == 1.01 * FOCAL


def test_deviation_holds_the_error_of_noisy_maps() -> None:
    """Oracle: the scene. Three deviations, of seeds that were not chosen."""
    for seed in (1, 2):
        noisy = withdrawal(8, seed=seed)
        views = [view_of(m, noisy.camera, 1) for m in noisy.maps()]
        found = focal_of(views, noisy.projector, noisy.projector_from_camera[0], free=True)
        error = abs(float(found.projector.focal) / FOCAL - 1)
        assert error < 3 * found.told.std < 0.01


def test_sum_is_the_weighted_mean_with_its_sandwich() -> None:
    """Oracle: the formula, on the list of frames."""
    rng = np.random.default_rng(0)
    information, pull = rng.uniform(1, 5, 7), rng.normal(0, 1, 7)
    told = FocalSum()
    for pair in zip(information, pull, strict=True):
        told = told.plus(*pair)
    mean = pull.sum() / information.sum()
    scatter = ((pull - information * mean) ** 2).sum() * 7 / 6
    assert told.change == pytest.approx(mean)
    assert told.std == pytest.approx(np.sqrt(scatter) / information.sum())
    assert np.isnan(FocalSum().plus(1.0, 0.1).std)

"""Cleaning of correspondence maps."""

import numpy as np
import pytest
from scipy import ndimage

from mitsuba_endo.initialisation.outlier_rejection import (
    clean_map,
    fill_nearest,
    median_filter,
    noise_scale,
)
from tests.rigs import random_rig, with_noise, with_outliers, with_slips


@pytest.fixture(scope="module")
def rig():
    return with_noise(random_rig(2, kind="sheet"), 0.3, 0)


def _wrong(corrupted, rig):
    return np.abs(corrupted.q - rig.q).max(-1) > 2.5


def test_keeps_a_good_map_whole(rig):
    """Oracle: nothing in it is wrong."""
    seen = np.isfinite(rig.q[..., 0])
    assert clean_map(rig.q)[seen].mean() > 0.999
    assert not clean_map(rig.q)[~seen].any()


def test_drops_gross_outliers(rig):
    """Oracle: the pixels that were replaced."""
    corrupted = with_outliers(rig, 0.3, 1)
    kept, wrong = clean_map(corrupted.q), _wrong(corrupted, rig)
    seen = np.isfinite(rig.q[..., 0])
    assert kept[wrong].mean() < 0.005
    assert kept[seen & ~wrong].mean() > 0.97


def test_cuts_out_slipped_patches(rig):
    """Oracle: the patches that were shifted by one period of 16 px."""
    corrupted = with_slips(rig, 0.1, 16.0, 1)
    kept, wrong = clean_map(corrupted.q), _wrong(corrupted, rig)
    seen = np.isfinite(rig.q[..., 0])
    assert kept[wrong].mean() < 0.02
    assert kept[seen & ~wrong].mean() > 0.97


def test_keeps_both_sides_of_a_depth_step():
    """Oracle: an object before a wall is two patches, both right."""
    y, x = np.mgrid[:60, :90].astype(float)
    q = np.stack([2 * x, 2 * y], -1)
    q[10:40, 20:60, 0] += 40
    kept = clean_map(q)
    assert kept[12:38, 22:58].all()
    assert kept[45:, :].all()


def test_keeps_a_thinned_map():
    """Oracle: pixels without neighbours cannot be cut from them."""
    q = np.full((60, 90, 2), np.nan)
    q[::3, ::3] = np.stack(np.meshgrid(np.arange(30.0), np.arange(20.0)), -1) * 4
    assert clean_map(q)[::3, ::3].all()


def test_an_empty_map_stays_empty():
    """Oracle: nothing seen, nothing kept."""
    assert not clean_map(np.full((20, 30, 2), np.nan)).any()


def test_fill_takes_the_nearest_value():
    """Oracle: SciPy's exact distance transform; OpenCV's 5x5 mask distance is 2 % off."""
    rng = np.random.default_rng(0)
    seen = rng.random((40, 55)) < 0.1
    values = rng.normal(size=(40, 55, 1))
    filled = fill_nearest(values, seen)
    assert (filled[seen] == values[seen]).all()
    y, x = np.mgrid[:40, :55]
    source = np.array([np.flatnonzero(values[..., 0].ravel() == v)[0] for v in filled.ravel()])
    reached = np.hypot(y.ravel() - source // 55, x.ravel() - source % 55)
    exact = np.asarray(ndimage.distance_transform_edt(~seen)).ravel()
    assert (reached <= 1.03 * exact + 1e-9).all()


def test_median_filter_agrees_with_scipy():
    """Oracle: scipy.ndimage.median_filter with the same replicated border."""
    values = np.random.default_rng(1).normal(size=(31, 42, 2)).astype(np.float32)
    expected = ndimage.median_filter(values, size=(5, 5, 1), mode="nearest")
    np.testing.assert_array_equal(median_filter(values, np.ones((31, 42), bool)), expected)


def test_noise_scale_measures_the_added_noise(rig):
    """Oracle: the standard deviation that was added."""
    corrupted = with_outliers(rig, 0.1, 2)
    assert noise_scale(corrupted.q, clean_map(corrupted.q)) == pytest.approx(0.3, rel=0.05)

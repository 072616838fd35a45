"""Structure of residuals against Monte Carlo."""

import numpy as np
import pytest

from mitsuba_endo.residual_statistics.structure import SMOOTHING_PX, structure
from tests.residual_statistics.noise import SHAPE, holes, white

DRAWS = 60


def test_large_white_image():
    """Oracle: an endless white image keeps 1 / (2 sqrt(pi) smoothing) of its RMS."""
    found = structure(white(np.random.default_rng(0), (300, 400)))
    assert found.white == pytest.approx(1 / (2 * np.sqrt(np.pi) * SMOOTHING_PX), rel=0.05)
    assert abs(found.deviations) < 4


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("weighted", [False, True])
def test_white_noise_has_the_expected_ratio(masked: bool, weighted: bool):
    """Oracle: Monte Carlo; the mean ratio within four standard errors, its spread within 35 %."""
    rng = np.random.default_rng(1)
    mask = holes(rng) if masked else np.ones(SHAPE, bool)
    weights = rng.uniform(0.2, 1, SHAPE) if weighted else None
    found = [
        structure(np.where(mask[..., None], white(rng), np.nan), weights) for _ in range(DRAWS)
    ]
    ratios = np.array([f.ratio for f in found])
    assert ratios.mean() == pytest.approx(found[0].white, abs=4 * ratios.std() / np.sqrt(DRAWS))
    assert found[0].white_std == pytest.approx(ratios.std(ddof=1), rel=0.35)


def test_the_mask_matters():
    """Oracle: where few neighbours are seen, smoothing averages less."""
    rng = np.random.default_rng(2)
    r = white(rng)
    few = np.where((rng.random(SHAPE) < 0.1)[..., None], r, np.nan)
    assert structure(few).white > 2.5 * structure(r).white


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_smooth_bias(share: float):
    """Oracle: the share of energy that is smooth, of which smoothing leaves exp(-(2 pi 5 / 66)^2).

    At the border half of the Gaussian is cut off and smooths less: 4 %.
    """
    rng = np.random.default_rng(3)
    x = np.arange(SHAPE[1])
    wave = np.sqrt(2) * np.sin(2 * np.pi * x / 66)[None, :, None]
    kept = np.exp(-((2 * np.pi * SMOOTHING_PX / 66) ** 2))
    r = np.sqrt(share) * wave + np.sqrt(1 - share) * white(rng)
    found = structure(r)
    assert found.excess == pytest.approx(kept * share, abs=0.01 + 0.04 * share)
    assert found.deviations > 10


def test_outliers_do_not_hide_structure():
    """Oracle: a tenth of gross errors with no weight changes nothing."""
    rng = np.random.default_rng(4)
    x = np.arange(SHAPE[1])
    r = np.sin(2 * np.pi * x / 66)[None, :, None] + 0.5 * white(rng)
    hit = rng.random(SHAPE) < 0.1
    spoilt = np.where(hit[..., None], 100 * white(rng), r)
    found = structure(spoilt, np.where(hit, 0.0, 1.0))
    assert found.ratio == pytest.approx(structure(r).ratio, rel=0.01)


@pytest.mark.parametrize("r", [np.zeros((8, 9, 2)), np.full((8, 9, 2), np.nan)])
def test_nothing_to_see(r: np.ndarray):
    """Oracle: the contract; no residuals have no structure."""
    assert np.isnan(structure(r).ratio)

"""Errors put on exact coordinates have the statistics asked for."""

import numpy as np

from mitsuba_endo.rendering.decoder_errors import like_decoded

SIZE = (500, 300)


def _exact() -> np.ndarray:
    q = np.full((120, 170, 2), 40.0)
    q[..., 1] = 250.0
    q[:10] = np.nan
    return q


def test_noise_without_outliers():
    """Oracle: standard deviation of 18,700 normal samples, within four of its own deviations."""
    decoded = like_decoded(_exact(), SIZE, noise_px=0.3, outliers=0, seed=1)
    np.testing.assert_array_equal(np.isnan(decoded), np.isnan(_exact()))
    error = (decoded - _exact())[10:]
    n = error[..., 0].size
    np.testing.assert_allclose(error.std((0, 1)), 0.3, atol=4 * 0.3 / np.sqrt(2 * n))
    np.testing.assert_allclose(error.mean((0, 1)), 0, atol=4 * 0.3 / np.sqrt(n))


def test_outliers():
    """Oracle: a binomial share of the seen pixels, uniform over the whole pattern."""
    decoded = like_decoded(_exact(), SIZE, noise_px=0, outliers=0.2, seed=2)
    changed = (decoded != _exact()).any(-1)[10:]
    assert abs(changed.mean() - 0.2) < 4 * np.sqrt(0.2 * 0.8 / changed.size)
    wrong = decoded[10:][changed]
    np.testing.assert_allclose(wrong.mean(0), (np.array(SIZE) - 1) / 2, rtol=0.05)
    assert (wrong > -0.5).all()
    assert (wrong < np.array(SIZE) - 0.5).all()
    assert wrong[:, 0].max() > 490
    assert wrong[:, 1].max() < 300


def test_seed_decides():
    """Oracle: the same seed gives the same errors, another seed others."""
    first, again, other = (like_decoded(_exact(), SIZE, 0.3, 0.1, seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other, equal_nan=True)

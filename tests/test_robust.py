"""The spread of values of which some are outliers."""

import numpy as np
import pytest
from scipy.stats import norm

from mitsuba_endo.robust import MAD_TO_STD, robust_std


def test_the_factor_is_the_normal_distributions() -> None:
    """Oracle: SciPy's quantile."""
    assert 1 / norm.ppf(0.75) == pytest.approx(MAD_TO_STD, abs=5e-6)


def test_outliers_hardly_count() -> None:
    """Oracle: the deviation drawn from; with a tenth of outliers the median is the
    quantile 0.5 / 0.9 of the rest, 13 % more."""
    errors = np.random.default_rng(1).normal(0, 0.3, (200, 500))
    assert robust_std(errors) == pytest.approx(0.3, rel=0.01)
    errors[:20] = 100.0
    expected = 0.3 * norm.ppf(0.5 + 0.5 * 0.5 / 0.9) / norm.ppf(0.75)
    assert robust_std(errors) == pytest.approx(expected, rel=0.01)

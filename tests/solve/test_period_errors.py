"""Counting period errors."""

import numpy as np

from mitsuba_endo.solve.inference.period_errors import count_period_errors


def test_counts_what_was_put_in():
    """Oracle: a known number of pixels shifted by whole periods among noise and other errors."""
    rng = np.random.default_rng(0)
    rendered = rng.uniform(0, 500, (40, 60, 2))
    observed = rendered + 0.3 * rng.standard_normal(rendered.shape)
    observed[5:10, 7:20] += [16.0, 0.0]
    observed[20:24, 30:40] += [0.0, -32.0]
    observed[30, 10:30] += [8.0, 0.0]  # half a period is another error
    observed[35:38] = np.nan
    rendered[5, 7:12] = np.nan
    assert count_period_errors(observed, rendered, 16.0) == 5 * 13 - 5 + 4 * 10

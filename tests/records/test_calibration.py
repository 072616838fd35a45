"""The arrays beside a solution."""

import numpy as np

from mitsuba_endo.records.calibration import FrameMaps


def test_residual_is_observed_minus_rendered():
    """Oracle: the subtraction by hand; missing on either side is missing."""
    observed = np.array([[[5, 9], [1, 1]]], np.float32)
    rendered = np.array([[[3, 10], [np.nan, np.nan]]], np.float32)
    maps = FrameMaps("a", observed, rendered, np.array([[True, False]]))
    np.testing.assert_array_equal(maps.residual, [[[2, -1], [np.nan, np.nan]]])

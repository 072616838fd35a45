"""The fisheye polynomial at its extremes, and its derivative."""

import numpy as np

from mitsuba_endo.geometry.kannala_brandt_distortion import KannalaBrandtDistortion


def test_fisheye_is_removed_exactly_beyond_90_degrees() -> None:
    """Oracle: the identity up to 115 degrees off the axis."""
    fisheye = KannalaBrandtDistortion((0.02, -0.01, 0.004, -0.0006))
    theta = np.linspace(0, 2.0, 41)
    np.testing.assert_allclose(fisheye.remove(fisheye.apply(theta)), theta, atol=1e-10)


def test_slope() -> None:
    """Oracle: central differences of ``apply`` with all four terms."""
    fisheye = KannalaBrandtDistortion((0.02, -0.01, 0.004, -0.0006))
    theta, step = np.linspace(0, 2.0, 41), 1e-6
    numerical = (fisheye.apply(theta + step) - fisheye.apply(theta - step)) / (2 * step)
    np.testing.assert_allclose(fisheye.slope(theta), numerical, atol=1e-8)

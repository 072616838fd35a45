"""Smoothing coordinates by fitted planes, against planes whose noise is known."""

import numpy as np
import pytest

from mitsuba_endo.decoding.grid.decode import DEFAULTS
from mitsuba_endo.decoding.grid.phase_unwrapping import smoothed_by_planes

NOISE = 0.04
"""Periods."""


def ramp(height: int = 60, width: int = 80) -> np.ndarray:
    """Return exact column and row of a slanted plane, ten pixels a period."""
    y, x = np.mgrid[:height, :width].astype(np.float32)
    return np.stack([3.7 + 0.1 * x + 0.03 * y, 11.2 - 0.02 * x + 0.09 * y], -1)


@pytest.mark.parametrize(("confidence", "most"), [(0.5, 0.25), (0.99, 1.0)])
def test_noise(confidence: float, most: float):
    """A plane with noise. Oracle: the plane; borders, where fits are one-sided, are included."""
    plane = ramp()
    noisy = plane + np.random.default_rng(0).normal(0, NOISE, plane.shape).astype(np.float32)
    smooth = smoothed_by_planes(noisy, np.full(plane.shape[:2], confidence, np.float32), DEFAULTS)
    assert np.std(smooth - plane) < most * NOISE + 1e-6
    if most == 1:
        np.testing.assert_array_equal(smooth, noisy)


def test_a_plane_stays():
    """No noise, and holes in the map. Oracle: a plane is its own fit, holes stay holes."""
    plane = ramp()
    plane[20:30, 15:40] = np.nan
    smooth = smoothed_by_planes(plane, np.full(plane.shape[:2], 0.4, np.float32), DEFAULTS)
    np.testing.assert_allclose(smooth, plane, atol=2e-3)


def test_folds_stay():
    """Two planes two periods apart. Oracle: beside the fold no pixel moves by a tenth."""
    plane = ramp()
    plane[:, 40:] += 2.0
    smooth = smoothed_by_planes(plane, np.full(plane.shape[:2], 0.4, np.float32), DEFAULTS)
    assert np.abs(smooth - plane)[:, 36:44].max() < 0.1

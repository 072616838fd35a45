"""Light spread inside tissue, against the profile's own Gaussians."""

import numpy as np

from mitsuba_endo.capture.diffusion import VARIANCES, profile_weights
from mitsuba_endo.learn.scattering import INDEX, spread

SHAPE = (161, 201)


def test_even_light_stays_even():
    """Oracle: the profile sends back what enters, near and far."""
    nearness = np.linspace(0.1, 1.2, SHAPE[0] * SHAPE[1], dtype=np.float32).reshape(SHAPE)
    out = spread(np.full(SHAPE, 0.7, np.float32), nearness, 2.0, 0.4)
    np.testing.assert_allclose(out, 0.7, rtol=1e-4)


def test_a_point_becomes_the_profile():
    """Oracle: the Gaussians' weighted variance; 2.4 times farther, as much narrower."""
    free_path = 1.5
    expected = (profile_weights(0.4, INDEX) * VARIANCES).sum() * free_path**2
    point = np.zeros(SHAPE, np.float32)
    point[80, 100] = 1
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] - np.array([80, 100])[:, None, None]
    near, far = (
        spread(point, np.full(SHAPE, nearness, np.float32), free_path, 0.4)
        for nearness in (1.0, 1 / 6**0.5)
    )
    for out, variance in ((near, expected), (far, expected / 6)):
        np.testing.assert_allclose(out.sum(), 1, rtol=1e-2)
        np.testing.assert_allclose((out * x * x).sum(), variance, rtol=0.05)
        np.testing.assert_allclose((out * y * y).sum(), variance, rtol=0.05)


def test_distance_between_two_widths_is_between():
    """Oracle: a peak falls steadily as tissue comes nearer."""
    point = np.zeros(SHAPE, np.float32)
    point[80, 100] = 1
    peaks = [spread(point, np.full(SHAPE, n, np.float32), 3.0, 0.4).max()
             for n in (0.2, 0.35, 0.5, 0.7, 1.0)]  # fmt: skip
    assert (np.diff(peaks) < 0).all()

"""The spread of light inside tissue."""

import numpy as np
import pytest

from mitsuba_endo.capture.diffusion import (
    VARIANCES,
    diffuse_reflectance,
    profile_weights,
    scattering_albedo,
)
from mitsuba_endo.capture.subsurface_blur import subsurface_blur

PER_MM = 5.0
"""Pixels per mm of the flat test surface."""


def _flat(height: int = 41, width: int = 151) -> tuple[np.ndarray, np.ndarray]:
    """Points (h, w, 3) of a plane across the view and pixels per mm (h, w)."""
    y, x = np.mgrid[:height, :width] / PER_MM
    points = np.stack([x, y, np.full(x.shape, 50.0)], -1).astype(np.float32)
    return points, np.full((height, width), PER_MM, np.float32)


def _line(height: int = 41, width: int = 151) -> np.ndarray:
    image = np.zeros((height, width, 3), np.float32)
    image[:, width // 2] = 1
    return image


def test_weights_make_the_profile_of_christensen_and_burley() -> None:
    """Oracle: without internal reflection (index 1) the share of light within a distance.

    The sum of five Gaussians follows 1 - exp(-s r) / 4 - 3 exp(-s r / 3) / 4 within 4 % of all.
    """
    reflectance = 0.6
    weights = profile_weights(reflectance, 1.0001)
    assert weights.sum() == pytest.approx(1)
    assert (weights >= 0).all()
    # Egan and Hilgeman's fit is 0.002 at index 1: practically no boundary.
    s = 1.9 - reflectance + 3.5 * (reflectance - 0.8) ** 2
    r = np.geomspace(0.1, 20, 40)
    share = 1 - 0.25 * np.exp(-s * r) - 0.75 * np.exp(-s * r / 3)
    made = (weights * (1 - np.exp(-0.5 * r[:, None] ** 2 / VARIANCES))).sum(1)
    np.testing.assert_allclose(made, share, atol=0.04)


def test_internal_reflection_and_paler_tissue_spread_light_further() -> None:
    """Oracle: the mean variance grows with the index and with the reflectance."""

    def width(reflectance: float, index: float) -> float:
        return float(profile_weights(reflectance, index) @ VARIANCES)

    assert width(0.5, 1.0) < width(0.5, 1.3) < width(0.5, 1.5)
    assert width(0.3, 1.4) < width(0.5, 1.4) < width(0.7, 1.4)


def test_albedo_is_the_inverse_of_reflectance() -> None:
    """Oracle: going there and back; a white half-space absorbs nothing."""
    for reflectance in (0.05, 0.4, 0.8):
        albedo = scattering_albedo(reflectance, 1.4)
        assert diffuse_reflectance(albedo, 1.4) == pytest.approx(reflectance)
    assert scattering_albedo(1.0, 1.4) == 1


def test_even_light_stays_even_and_a_line_keeps_its_light(llvm: str) -> None:
    """Oracle: a constant image; the total of a line far from the borders."""
    points, scale = _flat()
    even = np.full((41, 151, 3), 0.7, np.float32)
    args = (points, scale, 0.4, (0.7, 0.4, 0.3), 1.5)
    np.testing.assert_allclose(subsurface_blur(even, *args), even, rtol=1e-5)
    spread = subsurface_blur(_line(), *args)[20]
    np.testing.assert_allclose(spread.sum(0), 1, rtol=0.01)
    assert spread[75, 0] < spread[75, 2] < 0.9  # pale red goes further than blue


def test_a_line_spreads_by_the_variance_of_the_profile(llvm: str) -> None:
    """Oracle: second moment of the sum of Gaussians in mm, 10 % for sampling at 3 deviations."""
    points, scale = _flat()
    path = 0.4
    spread = subsurface_blur(_line(), points, scale, path, (0.6, 0.5, 0.4), 1.4)[20]
    x = (np.arange(151) - 75) / PER_MM
    for channel, reflectance in enumerate((0.6, 0.5, 0.4)):
        variance = float((spread[:, channel] * x**2).sum() / spread[:, channel].sum())
        expected = float(profile_weights(reflectance, 1.4) @ VARIANCES) * path**2
        assert variance == pytest.approx(expected, rel=0.1)


def test_no_light_crosses_a_depth_step_or_the_edge_of_the_mesh(llvm: str) -> None:
    """Oracle: zero on the other side; pixels that see nothing keep their value."""
    points, scale = _flat()
    points[:, 80:, 2] += 30
    points[:, :60] = np.nan
    spread = subsurface_blur(_line(), points, scale, 0.5, (0.6, 0.5, 0.4), 1.4)
    assert (spread[:, 80:] < 1e-6).all()
    assert (spread[:, :60] == 0).all()
    assert (spread[:, 72:79, 0] > 0.01).all()

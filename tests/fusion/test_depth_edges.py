"""Steep walls are smooth, leaps are not, whatever the noise."""

import numpy as np
import pytest

from mitsuba_endo.fusion.depth_edges import mended, noise, smooth_cells
from mitsuba_endo.geometry.transforms import RigidTransform
from tests.fusion.views import look, plane
from tests.rigs import lopsided_camera

CAMERA = lopsided_camera(90, 66)


def slanted(degrees: float) -> np.ndarray:
    """Ranges to a plane that the middle of the image meets at an angle of incidence."""
    a = np.radians(degrees)
    surface = plane((np.sin(a), 0.0, np.cos(a)), 40 * np.cos(a))
    return look(surface, CAMERA, RigidTransform.identity()).range


@pytest.mark.parametrize("degrees", [0, 50, -75])
def test_a_wall_is_smooth_at_any_usable_slant(degrees: float) -> None:
    ranges = slanted(degrees)
    rows, columns = slice(25, 40), slice(35, 50)
    assert smooth_cells(1 / ranges, CAMERA.grid_rays)[rows, columns].all()


def test_a_wall_seen_edge_on_is_not_used() -> None:
    ranges = slanted(86)
    assert not smooth_cells(1 / ranges, CAMERA.grid_rays)[25:40, 39:45].any()


@pytest.mark.parametrize("degrees", [0, 50])
@pytest.mark.parametrize("leap", [3.0, -3.0])
def test_a_leap_is_an_edge_along_rows_and_columns(degrees: float, leap: float) -> None:
    """Three millimetres at forty, seven pixels' widths; only cells across the leap are torn."""
    ranges = slanted(degrees)
    ranges[:, 41:] += leap
    ranges[31:, :20] += leap
    smooth = smooth_cells(1 / ranges, CAMERA.grid_rays)
    torn = np.zeros_like(smooth)
    torn[:, 40] = True
    torn[30, :19] = torn[30:, 19] = True
    inside = np.s_[20:50, 5:60]
    assert np.array_equal(~smooth[inside], torn[inside])


def test_noise_is_measured_in_spite_of_leaps_and_slant() -> None:
    inverse = 1 / slanted(50)
    inverse[:, ::15] *= 1.3
    noisy = inverse + 2e-4 * np.random.default_rng(0).standard_normal(inverse.shape)
    noisy[20:30, 20:30] = np.nan
    assert noise(noisy) == pytest.approx(2e-4, rel=0.35)
    assert noise(np.full((5, 5), np.nan)) == 0


def test_noise_does_not_tear_a_wall() -> None:
    """White noise of half a millimetre at 40 mm: more than a pixel is wide."""
    inverse = 1 / slanted(30)
    noisy = inverse + 3e-4 * np.random.default_rng(0).standard_normal(inverse.shape)
    assert smooth_cells(noisy, CAMERA.grid_rays).mean() > 0.995


def test_a_missing_pixel_takes_its_four_cells() -> None:
    inverse = 1 / slanted(20)
    inverse[30, 40] = np.nan
    smooth = smooth_cells(inverse, CAMERA.grid_rays)
    assert np.array_equal(np.argwhere(~smooth), [[29, 39], [29, 40], [30, 39], [30, 40]])


def test_single_pixels_are_mended_on_a_sheet() -> None:
    """Missing or wild, they become what lies between their neighbours."""
    exact = 1 / slanted(30)
    broken = exact.copy()
    broken[30, 40], broken[20, 10], broken[33, 60] = np.nan, 1 / 20, 1 / 90
    assert mended(broken, CAMERA.grid_rays) == pytest.approx(exact, rel=2e-3)


def test_nothing_is_mended_across_a_leap_or_a_wide_hole() -> None:
    """A line of shadow along a leap stays dark, and a hole of two by two pixels open."""
    inverse = 1 / slanted(0)
    inverse[:, 41:] *= 0.9
    inverse[:, 41] = np.nan
    inverse[20:22, 10:12] = np.nan
    after = mended(inverse, CAMERA.grid_rays)
    assert np.array_equal(after, inverse, equal_nan=True)

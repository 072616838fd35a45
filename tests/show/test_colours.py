"""Colour scales: round numbers, bands at the right places, order kept without colour vision."""

import numpy as np
import pytest
from matplotlib.colors import Normalize, to_rgba

from mitsuba_endo.show.colours import DEPTH, MISSING, banded, round_step, shaded


@pytest.mark.parametrize(
    ("extent", "parts", "expected"),
    [(1024, 14, 100), (800, 14, 50), (7, 14, 0.5), (0.03, 10, 0.002), (93, 10, 10), (0, 10, 1)],
)
def test_round_step(extent: float, parts: int, expected: float):
    """Oracle: the nearest of 1, 2, 5 by ratio; something positive where nothing extends."""
    assert round_step(extent, parts) == pytest.approx(expected)


def _luminance(rgba: np.ndarray) -> np.ndarray:
    return rgba[..., :3] @ [0.2126, 0.7152, 0.0722]


def test_band_borders_are_at_round_values():
    """Oracle: brightness jumps at the multiples of the band's width and nowhere else."""
    scale, norm, step = banded(3.0, 690.0)
    assert step == 50
    values = np.arange(0.5, 700, 1.0)
    jumps = np.abs(np.diff(_luminance(scale(norm(values)))))
    borders = (np.floor(values[1:] / step) != np.floor(values[:-1] / step)).nonzero()[0]
    assert len(borders) == 13
    # One colour step of 1024 may round either way at a border.
    near = np.zeros(len(jumps), bool)
    for b in borders:
        near[b - 1 : b + 2] = True
    assert jumps[~near].max() < 0.02
    assert all(jumps[b - 1 : b + 2].max() > 0.02 for b in borders)


def test_bands_of_a_kind_grow_brighter():
    """Oracle: within light and within dark bands, luminance alone orders the values."""
    scale, norm, step = banded(0.0, 700.0)
    middles = np.arange(step / 2, 700, step)
    light = _luminance(scale(norm(middles)))
    assert (np.diff(light[::2]) > 0).all()
    assert (np.diff(light[1::2]) > 0).all()


def test_missing_has_its_own_colour():
    """Oracle: the colour chosen for missing values."""
    scale, norm, _ = banded(0.0, 1.0)
    image = scale(norm(np.ma.masked_invalid([0.5, np.nan])))
    assert tuple(image[1]) == to_rgba(MISSING)
    depth = np.array([[1.0, np.nan]])
    normals = np.array([[[0, 0, -1.0], [np.nan] * 3]])
    assert tuple(shaded(depth, normals, DEPTH, Normalize(0, 2))[0, 1]) == to_rgba(MISSING)


def test_range_without_extent():
    """Oracle: a usable scale for a constant map."""
    _, norm, step = banded(5.0, 5.0)
    assert norm.vmin is not None
    assert norm.vmax is not None
    assert norm.vmin <= 5 < norm.vmax
    assert step > 0


def test_light_comes_from_the_upper_left():
    """Oracle: a facet turned to the upper left is brighter than its mirror image."""
    tilted = np.array([[[-0.5, -0.5, -0.7], [0.5, 0.5, -0.7]]])
    tilted /= np.linalg.norm(tilted, axis=-1, keepdims=True)
    image = shaded(np.ones((1, 2)), tilted, DEPTH, Normalize(0, 2))
    assert _luminance(image)[0, 0] > 1.2 * _luminance(image)[0, 1]

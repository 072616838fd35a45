"""The network's input from images of every kind."""

import cv2
import numpy as np
import pytest

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.decoding.normalise import normalise, one_channel
from mitsuba_endo.errors import InputError

GRID = CodedGrid(width=150, height=101, columns=14, rows=9, period=10.0)


def _picture() -> np.ndarray:
    light = GRID.texture(150, 101) * np.linspace(0.1, 1, 150)
    return np.round(light * 220).astype(np.uint8)


def test_depths_and_floats_agree():
    """Oracle: the same share of full scale gives the same input."""
    image = _picture()
    expected = normalise(image)
    assert expected.shape == (2, 101, 150)
    assert expected.dtype == np.float32
    np.testing.assert_allclose(normalise(image.astype(np.uint16) * 257), expected, atol=1e-4)
    np.testing.assert_allclose(normalise(image / 255), expected, atol=1e-4)


def test_exposure_hardly_matters():
    """Oracle: half the exposure is half of every number, which both channels divide out."""
    image = _picture() / 255
    full, half = normalise(image), normalise(image / 2)
    np.testing.assert_allclose(half[0], full[0], atol=1e-5)
    # FLOOR keeps the local channel below what it would be without noise.
    assert np.abs(half[1] - full[1]).max() < 0.15 * np.abs(full[1]).max()


def test_dark_end_shows_the_grid_as_the_bright_end_does():
    """Oracle: the local channel's spread does not follow a tenfold change of brightness."""
    raw, local = normalise(_picture())
    dark, bright = np.s_[:, 5:45], np.s_[:, 105:145]
    assert raw[dark].std() < 0.4 * raw[bright].std()
    assert local[dark].std() > 0.7 * local[bright].std()


@pytest.mark.parametrize("at", [0, 1, 2])
def test_white_reflections_are_taken_from_the_laser(at):
    """Oracle: light adds as squares of numbers of gamma 2, so L is left of sqrt(L^2 + W^2)."""
    rng = np.random.default_rng(at)
    laser = _picture() / np.float32(400)
    white = cv2.GaussianBlur(rng.uniform(0, 1, laser.shape).astype(np.float32), (0, 0), 1.5)
    white = 0.6 * (white > 0.52) + 0.2
    image = np.repeat(white[..., None], 3, axis=2).astype(np.float32)
    image[..., at] = np.sqrt(laser**2 + white**2)
    np.testing.assert_allclose(one_channel(image), laser, atol=2e-3)
    # An alpha channel plays no part.
    with_alpha = np.concatenate([image, np.ones((101, 150, 1), np.float32)], -1)
    np.testing.assert_array_equal(one_channel(with_alpha), one_channel(image))


def test_small_grid_beside_darkness():
    """Oracle: the laser's channel of a grid on a tenth of the image, other channels dark."""
    image = np.zeros((300, 450, 3), np.uint8)
    image[100:201, 150:300, 1] = _picture()
    own = one_channel(image)
    np.testing.assert_allclose(own[110:190, 200:290], _picture()[10:90, 50:140] / 255, atol=1e-6)


def test_a_white_pattern_stays():
    """Oracle: of equal channels with noise of their own one is returned as it is."""
    rng = np.random.default_rng(0)
    picture = _picture()[..., None] / np.float32(255)
    image = np.clip(picture + rng.normal(0, 0.03, (101, 150, 3)), 0, 1).astype(np.float32)
    taken = one_channel(image)
    assert any(np.array_equal(taken, image[..., k]) for k in range(3))
    np.testing.assert_array_equal(one_channel(np.repeat(picture, 3, axis=2)), picture[..., 0])


def test_an_even_image_gives_no_contrast():
    """Oracle: black and saturated images have zero deviation from their surroundings."""
    for value in (0, 255):
        channels = normalise(np.full((64, 80), value, np.uint8))
        assert np.isfinite(channels).all()
        assert np.abs(channels[1]).max() < 0.05


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 5), np.uint8),
        np.zeros((4, 5, 2), np.uint8),
        np.zeros(7),
        np.zeros((4, 5), bool),
    ],
)
def test_no_image_is_refused(image):
    with pytest.raises(InputError):
        normalise(image)


def test_the_image_is_left_alone():
    """Oracle: the caller's array is as before."""
    image = np.repeat(_picture()[..., None], 3, axis=2)
    before = image.copy()
    normalise(image)
    np.testing.assert_array_equal(image, before)

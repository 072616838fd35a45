"""Tone mapping keeps order and encodes as sRGB."""

import numpy as np

from mitsuba_endo.show.tonemap import tonemap


def test_srgb_values():
    """Oracle: sRGB's table: linear 0.2140 is 128 of 255 (middle grey), and white is white."""
    image = np.ones((40, 30, 3))
    image[0, 0], image[0, 1] = 0.2140, 0.0
    encoded = tonemap(7.5 * image)  # exposure takes the factor out
    assert encoded[1, 1].tolist() == [255, 255, 255]
    assert abs(int(encoded[0, 0, 0]) - 127.5) <= 1
    assert encoded[0, 1].tolist() == [0, 0, 0]


def test_a_glint_does_not_darken_the_rest():
    """Oracle: without the glint the image is white."""
    image = np.ones((40, 30, 3))
    image[3, 4] = 1000
    assert tonemap(image).min() == 255

"""From an image of any kind to the decoder network's input."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

INPUT_CHANNELS = 2
"""Of the network, whose weights expect them: brightness, and its local normalisation."""
REACH = 31
"""Window of the local normalisation, pixels: about three periods of the grid."""
FLOOR = 1.5 / 255
"""Contrast, of full scale, under which nothing is amplified: an 8-bit camera's last bits."""
OWN = 0.1
"""Share of a channel's detail that must remain when the other channels are taken away."""
ABOVE_NOISE = 0.7
"""Strength of the remaining detail over that of noise; white noise alone has 0.45."""
BRIGHT = 99.0
"""Percentile of the image that becomes 1 in the first channel."""


def normalise(image: NDArray[np.integer] | NDArray[np.floating]) -> NDArray[np.float32]:
    """Return the network's input (2, H, W) of an image (H, W) or (H, W, 3 or 4).

    Channel 0 is the image over its 99th percentile, at most 2. Channel 1 is each pixel's deviation
    from its surroundings' mean over their standard deviation, within -4 to 4: it shows the grid in
    the dark far lumen as in the bright wall. Both hardly change with exposure.

    Args:
        image: 8 or 16 bit of full range, or floats where 1 is full scale.

    Raises:
        InputError: not an image, or of another kind of number.
    """
    gray = one_channel(image)
    bright = max(float(np.percentile(gray, BRIGHT)), 4 * FLOOR)
    window = (REACH, REACH)
    mean = cv2.boxFilter(gray, -1, window, borderType=cv2.BORDER_REFLECT)
    squares = cv2.boxFilter(gray * gray, -1, window, borderType=cv2.BORDER_REFLECT)
    spread = np.sqrt(np.maximum(squares - mean * mean, 0))
    local = (gray - mean) / (spread + FLOOR)
    return np.stack([np.clip(gray / bright, 0, 2), np.clip(local, -4, 4)]).astype(np.float32)


def one_channel(image: NDArray[np.integer] | NDArray[np.floating]) -> NDArray[np.float32]:
    """Return brightness (H, W), of full scale; of a colour image the laser's own light.

    That is the channel with most detail less the others' mean: the laser has one colour, while
    reflections of the lamp from wet tissue are white. If only noise remains, the pattern itself is
    white, and the channel with most detail is taken as it is.

    Raises:
        InputError: not an image, or of another kind of number.
    """
    values = _checked(image)
    scale = {"uint8": 1 / 255, "uint16": 1 / 65535}.get(values.dtype.name, 1.0)
    planes = np.nan_to_num(np.atleast_3d(values)[..., :3].astype(np.float32)) * np.float32(scale)
    channels = [np.ascontiguousarray(np.clip(planes[..., k], 0, 1)) for k in range(planes.shape[2])]
    if len(channels) == 1:
        return channels[0]
    return _laser_light(channels)


def _laser_light(channels: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Return the laser's own light of three channels, signed: see :func:`one_channel`."""
    # Squares undo the usual gamma well enough for light to be subtracted from light.
    squares = [channel * channel for channel in channels]
    white = np.minimum(np.minimum(squares[0], squares[1]), squares[2])
    laser = int(np.argmax([_detail(square - white)[0] for square in squares]))
    own = squares[laser] - np.float32(0.5) * (squares[laser - 1] + squares[laser - 2])
    detail, noise = _detail(own)
    if detail < ABOVE_NOISE * noise or detail < OWN * _detail(squares[laser])[0]:
        return channels[int(np.argmax([_detail(square)[0] for square in squares]))]
    return (np.sign(own) * np.sqrt(np.abs(own))).astype(np.float32)


def _checked(image: NDArray[np.generic]) -> NDArray[np.generic]:
    values = np.asarray(image)
    plain = values.ndim in (2, 3) and 0 not in values.shape
    if not plain or values.shape[2:] not in [(), (1,), (3,), (4,)]:
        raise InputError(f"has shape {values.shape}", "image", "give one gray or colour image")
    if values.dtype not in (np.uint8, np.uint16) and not np.issubdtype(values.dtype, np.floating):
        raise InputError(f"is {values.dtype}", "image", "give 8 or 16 bits or floats")
    return values


def _detail(light: NDArray[np.floating]) -> tuple[float, float]:
    """Return the strength of what is as fine as the grid, and of what is finer: noise.

    Of each the 95th percentile, so that a twentieth of the image with the grid is enough.
    """
    border = cv2.BORDER_REFLECT
    fine = cv2.boxFilter(light, -1, (3, 3), borderType=border)
    coarse = cv2.boxFilter(light, -1, (11, 11), borderType=border)
    detail, noise = (np.abs(part[::2, ::2]) for part in (fine - coarse, light - fine))
    return float(np.percentile(detail, 95)), float(np.percentile(noise, 95))

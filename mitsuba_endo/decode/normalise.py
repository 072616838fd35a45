"""From an image of any kind to the decoder network's input."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

INPUT_CHANNELS = 2
REACH = 31
"""Window of the local normalisation, pixels: about three periods of the grid."""
FLOOR = 1.5 / 255
"""Contrast, of full scale, under which nothing is amplified: an 8-bit camera's last bits."""
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
    return np.stack([np.minimum(gray / bright, 2), np.clip(local, -4, 4)]).astype(np.float32)


def one_channel(image: NDArray[np.integer] | NDArray[np.floating]) -> NDArray[np.float32]:
    """Return brightness (H, W) from 0 to 1; of a colour image the channel with most fine detail.

    A DOE's laser has one colour, and a sum of the channels would add the others' light and noise.

    Raises:
        InputError: not an image, or of another kind of number.
    """
    values = np.asarray(image)
    if (
        values.ndim not in (2, 3)
        or 0 in values.shape
        or values.shape[2:] not in [(), (1,), (3,), (4,)]
    ):
        raise InputError(f"has shape {values.shape}", "image", "give one gray or colour image")
    if values.dtype == np.uint8:
        scale = 1 / 255
    elif values.dtype == np.uint16:
        scale = 1 / 65535
    elif np.issubdtype(values.dtype, np.floating):
        values, scale = np.nan_to_num(values), 1.0
    else:
        raise InputError(f"is {values.dtype}", "image", "give 8 or 16 bits or floats")
    planes = np.atleast_3d(values)[..., :3].astype(np.float32) * np.float32(scale)
    channels = [np.ascontiguousarray(planes[..., k]) for k in range(planes.shape[2])]
    return np.clip(max(channels, key=_detail), 0, 1)


def _detail(channel: NDArray[np.float32]) -> float:
    """Return the strength of detail as fine as the grid, coarser than pixel noise."""
    fine = cv2.GaussianBlur(channel, (0, 0), 1.2) - cv2.GaussianBlur(channel, (0, 0), 5.0)
    return float(fine.std())

"""What a refinement looks at: an image's light on the cells' grid, and which pixels may be used."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.normalise import one_channel
from .cells import Image, padded

SATURATED = 0.98
"""Share of full scale from which a pixel says nothing but that it is bright."""
HALO = np.ones((3, 3), np.uint8)
"""Pixels around a saturated one that are left out too: the lens spreads it by about a pixel."""


@dataclass(frozen=True, eq=False)
class ImageView:
    """One image; all arrays are filled up to whole cells."""

    light: Image
    """(H, W) linear brightness over its median where coordinates are known."""
    clear: NDArray[np.bool_]
    """(H, W) inside the image, and not saturated."""
    size: tuple[int, int]
    """Rows and columns of the image itself."""


def view_of(
    image: NDArray[np.integer] | NDArray[np.floating], valid: NDArray[np.bool_], gamma: float
) -> ImageView:
    """Return what is to be looked at of an image.

    Args:
        image: (H, W) or (H, W, 3), 8 or 16 bit, or floats where 1 is full scale.
        valid: (H, W) pixels with a coordinate.
        gamma: the image holds brightness^(1 / gamma).

    Raises:
        InputError: not an image.
    """
    gray = one_channel(image)
    light = np.sign(gray) * np.abs(gray) ** np.float32(gamma)
    middle = float(np.median(light[valid])) if valid.any() else 0.0
    light = light / max(middle, 1e-6)
    bright = (_largest(image) >= SATURATED).astype(np.uint8)
    clear = cv2.dilate(bright, HALO) == 0
    return ImageView(padded(light.astype(np.float32)), padded(np.asarray(clear), False), gray.shape)


def _largest(image: NDArray) -> Image:
    """Return the brightest channel (H, W), of full scale."""
    values = np.atleast_3d(image)[..., :3]
    scale = np.iinfo(values.dtype).max if values.dtype.kind in "iu" else 1.0
    brightest = values[..., 0]
    for k in range(1, values.shape[2]):
        brightest = np.maximum(brightest, values[..., k])
    return brightest.astype(np.float32) / np.float32(scale)

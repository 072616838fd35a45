"""From linear signal to the numbers in an image file."""

import cv2
import numpy as np
from numpy.typing import NDArray

Encoded = NDArray[np.uint8] | NDArray[np.uint16]


def encode(signal: NDArray[np.float32], gamma: float, bits: int) -> Encoded:
    """Clip to [0, 1], apply the power 1 / gamma, round to ``bits`` (8 or 16) bits."""
    top = 2**bits - 1
    value = np.clip(signal, 0, 1)
    if gamma != 1:
        value = cv2.pow(value, 1 / gamma).reshape(value.shape)
    return (value * top + 0.5).astype(np.uint8 if bits == 8 else np.uint16)


def linear(image: Encoded, gamma: float) -> NDArray[np.float32]:
    """Return the linear signal of an encoded image: the inverse up to rounding and clipping."""
    return (image.astype(np.float32) / np.float32(np.iinfo(image.dtype).max)) ** np.float32(gamma)

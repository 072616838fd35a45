"""Blur of the lens."""

import cv2
import numpy as np
from numpy.typing import NDArray


def defocus(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Convolve with a Gaussian of standard deviation ``sigma`` pixels; (h, w, c) linear.

    The image is mirrored at its edge. Below about 0.4 pixels the sampled kernel is narrower than
    ``sigma``, because it is zero at the neighbouring pixel.
    """
    if sigma == 0:
        return image
    blurred = cv2.GaussianBlur(image, (0, 0), sigma, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(blurred, np.float32).reshape(image.shape)

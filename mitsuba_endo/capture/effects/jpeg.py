"""JPEG compression."""

import cv2
import numpy as np
from numpy.typing import NDArray


def jpeg(image: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    """Return the (h, w, c) image as it is after compression with ``quality`` 1 to 100.

    Colour is subsampled (4:2:0), as is usual.
    """
    swapped = image[..., ::-1]  # OpenCV's order of colours is blue, green, red
    encoded, data = cv2.imencode(".jpg", swapped, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not encoded:
        raise ValueError(f"an image of shape {image.shape} cannot be a JPEG")
    back = np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), np.uint8).reshape(image.shape)
    return np.ascontiguousarray(back[..., ::-1])

"""Blur by motion of the camera during the exposure."""

import cv2
import numpy as np
from numpy.typing import NDArray


def motion_blur(image: NDArray[np.float32], length: float, angle: float) -> NDArray[np.float32]:
    """Average along a straight way of ``length`` pixels in direction ``angle`` (radians, x to y).

    Args:
        image: (h, w, c) linear, mirrored at its edge.
        length: of the path, pixels; 0 = still.
        angle: of the path, radians from +x towards +y.
    """
    if length == 0:
        return image
    kernel = line_kernel(length, angle)
    blurred = cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(blurred, np.float32).reshape(image.shape)


def line_kernel(length: float, angle: float) -> NDArray[np.float32]:
    """Return the (n, n) kernel of a line through its middle, bilinearly sampled, of sum 1."""
    steps = max(2, int(np.ceil(8 * length)))
    along = ((np.arange(steps) + 0.5) / steps - 0.5) * length
    reach = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1))
    x, y = reach + along * np.cos(angle), reach + along * np.sin(angle)
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    for dx in (0, 1):
        for dy in (0, 1):
            weight = np.abs(1 - dx - (x - x0)) * np.abs(1 - dy - (y - y0))
            np.add.at(kernel, (y0 + dy, x0 + dx), weight)
    return (kernel / kernel.sum()).astype(np.float32)

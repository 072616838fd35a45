"""Exposure: from radiance to the share of the sensor's full scale."""

import numpy as np
from numpy.typing import NDArray

BRIGHT_PERCENTILE = 99.5
"""Percentile of the brightest channel that automatic exposure puts to full scale."""


def exposure_gain(image: NDArray[np.float32], exposure: float, automatic: bool) -> float:
    """Return the factor from radiance (h, w, c) to share of full scale.

    A black image keeps the plain factor.
    """
    if not automatic:
        return exposure
    bright = float(np.percentile(image.max(-1), BRIGHT_PERCENTILE))
    return exposure / bright if bright > 0 else exposure


def to_gray(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the luminance (h, w, 1) of linear RGB (h, w, 3), Rec. 709; one channel stays."""
    if image.shape[2] == 1:
        return image
    return image @ np.array([[0.2126], [0.7152], [0.0722]], np.float32)

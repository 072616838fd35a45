"""Linear radiance to an image for the screen."""

import numpy as np
from numpy.typing import NDArray

_WHITE_PERCENTILE = 99.5
"""Of the brightest channel, per cent. Chosen: glints are fewer pixels."""
_LINEAR_UNTIL = 0.0031308
"""Radiance below which sRGB is linear (IEC 61966-2-1)."""


def tonemap(image: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Expose and encode a linear RGB image (H, W, 3) as 8-bit sRGB (IEC 61966-2-1).

    White is the 99.5th percentile of the brightest channel, so that glints do not darken the rest.
    """
    brightest = image.max(-1)
    finite = brightest[np.isfinite(brightest)]
    white = float(np.percentile(finite, _WHITE_PERCENTILE)) if finite.size else 1.0
    linear = np.clip(np.nan_to_num(image) / max(white, 1e-12), 0, 1)
    encoded = np.where(
        linear <= _LINEAR_UNTIL, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055
    )
    return np.round(255 * encoded).astype(np.uint8)

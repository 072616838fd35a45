"""Natural falloff of illumination towards the edge of the image."""

import numpy as np
from numpy.typing import NDArray


def vignetting(
    image: NDArray[np.float32], cosine: NDArray[np.floating], strength: float
) -> NDArray[np.float32]:
    """Multiply by cos^(4 strength), the law of a thin lens for strength 1.

    Args:
        image: (h, w, c) linear.
        cosine: (h, w) cosine of the angle between a pixel's ray and the optical axis; rays beyond
            90 degrees get nothing.
        strength: 0 = no falloff.
    """
    if strength == 0:
        return image
    falloff = np.clip(cosine, 0, 1).astype(np.float32) ** np.float32(4 * strength)
    return (image * falloff[..., None]).astype(np.float32, copy=False)


def wide_angle_cosine(height: int, width: int) -> NDArray[np.float32]:
    """Return the (h, w) cosine of a pinhole camera that sees 90 degrees along the diagonal."""
    x = np.arange(width, dtype=np.float32) - (width - 1) / 2
    y = np.arange(height, dtype=np.float32) - (height - 1) / 2
    focal = np.hypot(width, height) / 2
    return focal / np.sqrt(x[None] ** 2 + y[:, None] ** 2 + focal**2).astype(np.float32)

"""Light that spreads inside the tissue of a training image: more pixels of it where it is near."""

import cv2
import numpy as np
from numpy.typing import NDArray

from ..capture.diffusion import VARIANCES, profile_weights

INDEX = 1.4
"""Refractive index of tissue."""
FARTHEST = 2
"""Steps of the profile's widths by which tissue may be smaller than where it is nearest: six times
farther away."""
SHARP = 0.3
"""Standard deviation, pixels, below which a blur would change nothing."""
_RATIO = float(np.sqrt(VARIANCES[1] / VARIANCES[0]))
"""Of the widths of neighbouring Gaussians of the profile."""


def spread(
    light: NDArray[np.float32],
    nearness: NDArray[np.float32],
    free_path: float,
    reflectance: float,
) -> NDArray[np.float32]:
    """Return light (H, W) as a scattering half-space sends it back.

    The profile is that of :mod:`..capture.diffusion`, a sum of Gaussians each wider than the one
    before by the same factor. So the image is blurred once for each width, and every pixel mixes
    blurred images by its distance; between two widths linearly. Light crosses depth steps here.

    Args:
        light: that enters.
        nearness: (H, W) 1 / distance, 1 where the tissue is nearest.
        free_path: reduced mean free path at nearness 1, pixels.
        reflectance: of the tissue.
    """
    weights = np.concatenate([[0.0], profile_weights(reflectance, INDEX), [0.0]])
    steps = np.arange(-1, len(VARIANCES) + 1)
    smaller = np.log(np.clip(nearness, _RATIO**-FARTHEST, 1)) / np.float32(np.log(_RATIO))
    total = np.zeros_like(light)
    for level in range(-FARTHEST, len(VARIANCES)):
        width = free_path * np.sqrt(VARIANCES[0]) * _RATIO**level
        blurred = cv2.GaussianBlur(light, (0, 0), width) if width > SHARP else light
        total += np.interp(level - smaller, steps, weights).astype(np.float32) * blurred
    return total

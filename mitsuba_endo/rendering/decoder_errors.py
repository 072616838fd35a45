"""Errors like those of a decoder, put on exact projector coordinates."""

import numpy as np
from numpy.typing import NDArray


def like_decoded(
    q: NDArray[np.floating], size: tuple[int, int], noise_px: float, outliers: float, seed: int
) -> NDArray[np.float32]:
    """Return exact coordinates with Gaussian noise and gross outliers.

    Args:
        q: (H, W, 2) exact coordinates, pattern pixels, NaN = missing.
        size: width and height of the pattern, pixels.
        noise_px: standard deviation of the noise of each component, pattern pixels.
        outliers: share of the correspondences replaced by ones uniform over the pattern, 0 to 1.
        seed: of the random numbers.

    Returns:
        (H, W, 2) map; what was missing still is.
    """
    rng = np.random.default_rng(seed)
    decoded = q + noise_px * rng.standard_normal(q.shape)
    hit = np.isfinite(q).all(-1) & (rng.random(q.shape[:2]) < outliers)
    decoded[hit] = rng.uniform(-0.5, np.array(size) - 0.5, (int(hit.sum()), 2))
    return decoded.astype(np.float32)

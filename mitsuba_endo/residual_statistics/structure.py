"""Structure of residuals: how much of them is smooth, beside what white noise would leave.

An error of the model is alike over many pixels, noise is not: smoothing keeps the one and averages
the other away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d

SMOOTHING_PX = 5.0
"""Standard deviation of the Gaussian: wider than a pixel's neighbourhood that a fitted surface or a
decoder ties together, narrower than the patterns that wrong intrinsics leave."""
_TRUNCATE = 4.0
"""Standard deviations at which the Gaussian ends: 6e-5 of its weight lies beyond."""


@dataclass(frozen=True)
class Structure:
    """Root mean square of the smoothed residuals over that of the residuals."""

    ratio: float
    """0 to 1; NaN without residuals."""
    white: float
    """What white noise under the same mask and weights gives, in expectation."""
    white_std: float
    """Standard deviation of the ratio under such noise."""

    @property
    def excess(self) -> float:
        """Share of the residuals' energy that is smooth beyond what white noise leaves."""
        return max(self.ratio**2 - self.white**2, 0.0)

    @property
    def deviations(self) -> float:
        """Standard deviations by which the ratio exceeds that of white noise."""
        return (self.ratio - self.white) / self.white_std


def structure(
    residuals: NDArray[np.floating],
    weights: NDArray[np.floating] | None = None,
    smoothing_px: float = SMOOTHING_PX,
) -> Structure:
    """Compare the smoothed residuals with the residuals (H, W, 2), both components together.

    With Gaussian k and weights w the smoothed residual is s = k*(w r) / k*w (normalised
    convolution). For white noise of variance v its variance is v (k^2 * w^2) / (k*w)^2 at each
    pixel, of which the mean is the expectation.

    Args:
        residuals: NaN = missing.
        weights: (H, W) of the robust loss, 0 to 1; 1 where absent.
        smoothing_px: standard deviation of the Gaussian, pixels.
    """
    w = usable_weights(residuals, weights)
    r = np.where(w[..., None] > 0, residuals, 0.0)
    energy = float((w[..., None] * r * r).sum())
    if energy == 0:
        return Structure(np.nan, np.nan, np.nan)
    kernel = _gaussian(smoothing_px)
    around = np.where(w > 0, _filtered(w, kernel), 1.0)
    smooth = np.stack([_filtered(w * r[..., c], kernel) / around for c in range(2)], -1)
    gain = _filtered(w * w, kernel * kernel) / around**2
    white = np.sqrt(float((w * gain).sum() / w.sum()))
    # Squared, the correlation exp(-d^2 / 4 smoothing^2) covers 2 pi smoothing^2 pixels, of which a
    # mask shows a part. A mean square of n Gaussians varies by sqrt(2 / n), its root by half of it.
    density = float((w * around).sum() / w.sum())
    independent = 2 * w.sum() / (density * 2 * np.pi * smoothing_px**2)
    spread = 0.5 * np.sqrt(2 / independent)
    ratio = np.sqrt(float((w[..., None] * smooth**2).sum()) / energy)
    return Structure(float(ratio), float(white), float(white * spread))


def usable_weights(
    residuals: NDArray[np.floating], weights: NDArray[np.floating] | None
) -> NDArray[np.float64]:
    """Return weights (H, W) that are zero where a residual (H, W, 2) or weight is missing."""
    finite = np.asarray(np.isfinite(residuals).all(-1))
    if weights is None:
        return finite.astype(np.float64)
    return np.where(finite & (weights > 0), weights, 0.0).astype(np.float64)


def _gaussian(sigma: float) -> NDArray[np.float64]:
    x = np.arange(-round(_TRUNCATE * sigma), round(_TRUNCATE * sigma) + 1)
    kernel = np.exp(-0.5 * (x / sigma) ** 2)
    return np.asarray(kernel / kernel.sum())


def _filtered(image: NDArray[np.float64], kernel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Filter along both axes, zero beyond the image."""
    rows = correlate1d(image, kernel, axis=0, mode="constant")
    return correlate1d(rows, kernel, axis=1, mode="constant")

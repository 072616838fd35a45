"""Where a range image leaps from one sheet of a surface to another.

The inverse range is linear over a plane. So between two pixels of one smooth sheet it changes
about as much as between the pixels before or behind, however steep the wall; at an edge it
changes far more than on both sides.
"""

import numpy as np
from numpy.typing import NDArray

from ..robust import robust_std

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STEEPEST = float(np.tan(np.radians(82)))
"""Tangent of the incidence beyond which a wall is not used: a pixel is seven times as long there
as it is wide, and a leap over two pixels looks the same."""
FREE_STEP = 2.0
"""Pixels' widths that the range may change by without being an edge: below what pixels resolve."""
NOISE_DEVIATIONS = 5.0
"""Standard deviations of the difference of two pixels that noise is trusted to stay within."""


def smooth_cells(inverse_range: Floats, rays: Floats) -> Bools:
    """Tell where four neighbouring pixels see one sheet of the surface.

    Args:
        inverse_range: (H, W), NaN = not seen.
        rays: (H, W, 3) unit directions.

    Returns:
        (H - 1, W - 1) true where the four pixels are seen and no edge passes between them.
    """
    across = _joined(inverse_range, rays)
    down = _joined(inverse_range.T, rays.transpose(1, 0, 2)).T
    return across[:-1] & across[1:] & down[:, :-1] & down[:, 1:]


def mended(inverse_range: Floats, rays: Floats) -> Floats:
    """Return the image with single wild or missing pixels interpolated, where that is safe.

    Wild is a pixel that no neighbour joins. It, and a missing one, becomes the mean of those beside
    it, or above and below, that differ by no more than two pixels of one sheet may; else NaN.

    Args:
        inverse_range: (H, W), NaN = not seen.
        rays: (H, W, 3) unit directions.
    """
    across = np.pad(_joined(inverse_range, rays), ((0, 0), (1, 1)))
    down = np.pad(_joined(inverse_range.T, rays.transpose(1, 0, 2)).T, ((1, 1), (0, 0)))
    alone = ~(across[:, 1:] | across[:, :-1] | down[1:] | down[:-1])
    kept = np.where(alone, np.nan, inverse_range)
    beside = _bridged(kept, rays)
    above = _bridged(kept.T, rays.transpose(1, 0, 2)).T
    both = np.where(
        np.isnan(beside), above, np.where(np.isnan(above), beside, (beside + above) / 2)
    )
    return np.where(np.isnan(kept), both, kept)


def _bridged(inverse: Floats, rays: Floats) -> Floats:
    """Return the means (H, W) of the two pixels beside each in a row; NaN where they leap."""
    first, last = inverse[:, :-2], inverse[:, 2:]
    angle = np.linalg.norm(rays[:, 2:] - rays[:, :-2], axis=-1)
    mean = (first + last) / 2
    slack = FREE_STEP * angle * mean + NOISE_DEVIATIONS * np.sqrt(2) * noise(inverse)
    with np.errstate(invalid="ignore"):
        near = np.abs(last - first) <= slack
    return np.pad(np.where(near, mean, np.nan), ((0, 0), (1, 1)), constant_values=np.nan)


def _joined(inverse: Floats, rays: Floats) -> Bools:
    """Tell which neighbours along a row (H, W - 1) belong to one sheet."""
    step = np.diff(inverse, axis=1)
    angle = np.linalg.norm(np.diff(rays, axis=1), axis=-1)
    mean = (inverse[:, 1:] + inverse[:, :-1]) / 2
    before, behind = (np.zeros_like(step) for _ in range(2))
    before[:, 1:], behind[:, :-1] = np.nan_to_num(step[:, :-1]), np.nan_to_num(step[:, 1:])
    slack = FREE_STEP * angle * mean + NOISE_DEVIATIONS * np.sqrt(2) * noise(inverse)
    low = np.minimum(0, np.minimum(before, behind)) - slack
    high = np.maximum(0, np.maximum(before, behind)) + slack
    with np.errstate(invalid="ignore"):
        return (step >= low) & (step <= high) & (np.abs(step) <= STEEPEST * angle * mean + slack)


def noise(inverse_range: Floats) -> float:
    """Return the standard deviation of white noise (H, W), from second differences along rows.

    Their median is blind to edges; what a smooth surface bends by counts as noise.
    """
    second = np.diff(inverse_range, n=2, axis=1)
    second = second[np.isfinite(second)]
    # A second difference has sqrt(1 + 4 + 1) times the noise.
    return robust_std(second) / np.sqrt(6) if len(second) else 0.0

"""Synthetic views with exact coordinates for the refinement: no renderer, no decoder."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.records.correspondence import CorrespondenceMap

HEIGHT, WIDTH = 150, 200
GRID = CodedGrid()
PERIOD = GRID.period


def coordinates(fold: bool = False) -> NDArray[np.float64]:
    """Return smooth coordinates (H, W, 2), 9 camera pixels a period; a fold lies at x = 100."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    u = 90 + 1.30 * x + 0.12 * y + 1.5 * np.sin(x / 31) + 0.8 * np.sin(y / 23)
    v = 70 - 0.09 * x + 1.25 * y + 1.1 * np.sin(x / 27 + y / 40)
    if fold:
        u = u + np.where(x >= 100, 17.3, 0.0)
    return np.stack([u, v], -1)


def photo(
    q: NDArray[np.float64],
    *,
    seed: int = 0,
    speckle: float = 0.0,
    gamma: float = 2.2,
    bits: int = 8,
    light: NDArray[np.float64] | None = None,
) -> NDArray[np.integer]:
    """Return a gray image (H, W) of the default grid at ``q`` under uneven light, with noise."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: q.shape[0], : q.shape[1]]
    shading = 0.5 + 0.3 * np.sin(x / 40) * np.cos(y / 30)
    bright = GRID.brightness(q) if light is None else light
    image = gaussian_filter(shading * bright + 0.02, 0.6)
    if speckle:
        grain = gaussian_filter(rng.standard_normal(image.shape), 0.85)
        image = image * np.maximum(1 + speckle * grain / grain.std(), 0)
    image = image + 0.004 * rng.standard_normal(image.shape)
    top = 2**bits - 1
    return np.rint(top * np.clip(image, 0, 1) ** (1 / gamma)).astype(f"u{bits // 8}")


def wrong_by(q: NDArray[np.float64], size: float = 0.6, seed: int = 1) -> CorrespondenceMap:
    """Return a decoder's map: smooth errors of this size, as a network makes, pattern pixels."""
    rng = np.random.default_rng(seed)
    error = gaussian_filter(rng.standard_normal(q.shape), (14, 14, 0))
    fine = gaussian_filter(rng.standard_normal(q.shape), (2, 2, 0))
    error = size * error / error.std() + 0.1 * fine / fine.std()
    return CorrespondenceMap((q + error).astype(np.float32), "frame")


def rms(q: NDArray, truth: NDArray[np.float64], border: int = 8) -> float:
    """Return the root mean square error off the image's border, pattern pixels."""
    inside = (slice(border, -border), slice(border, -border))
    error = (q - truth)[inside]
    return float(np.sqrt(np.nanmean(error**2)))

"""Where else in the pattern the image might be: places that look alike, a period away."""

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from .cells import SIDE, Image
from .iterate import DARK, FIRST_BLUR, Comparison, Refined, robust_weight
from .pattern_image import PatternImage
from .windows import Windows

ALIKE = 0.15
"""Correlation of the pattern with itself from which a shift is an alternative."""
MOST = 8
"""Alternatives at most, the nearest: the neighbours in a grid."""
FARTHEST = 0.125
"""Share of the pattern's smaller side within which they are sought: farther slips do not happen
pixel by pixel."""
WIDER = 2.0
"""Windows of the comparison over those of the regression: they must hold some of the code."""


@lru_cache(8)
def alternative_shifts(pattern: PatternImage) -> NDArray[np.float32]:
    """Return the shifts (K, 2), pattern pixels, by which a pattern resembles itself.

    They are the nearest local maxima of its normalised autocorrelation, but for the middle. A
    pattern without such maxima has none.
    """
    x = np.arange(pattern.width, dtype=np.float32)
    y = np.arange(pattern.height, dtype=np.float32)
    value = pattern.brightness(np.stack(np.meshgrid(x, y), -1), FIRST_BLUR)
    value = value - value.mean()
    padded = [2 * n for n in value.shape]
    power = np.abs(np.fft.rfft2(value, padded)) ** 2
    overlap = np.abs(np.fft.rfft2(np.ones_like(value), padded)) ** 2
    raw, area = (np.fft.irfft2(p, padded) for p in (power, overlap))
    reach = int(FARTHEST * min(value.shape))
    near = np.arange(-reach, reach + 1)
    correlation = (raw / np.maximum(area, 1))[np.ix_(near, near)]
    correlation = (correlation / correlation[reach, reach]).astype(np.float32)
    peak = (correlation == cv2.dilate(correlation, np.ones((5, 5)))) & (correlation >= ALIKE)
    peak[reach, reach] = False
    rows, columns = np.nonzero(peak)
    order = np.argsort(np.hypot(rows - reach, columns - reach), kind="stable")[:MOST]
    return np.stack([columns - reach, rows - reach], -1)[order].astype(np.float32)


def contest(frame: Comparison, refined: Refined) -> tuple[Image, Image]:
    """Return how well image and pattern correlate (h, w) here, and at each cell's best alternative.

    The latter is -1 where there are no alternatives.
    """
    windows = Windows(frame.links, WIDER * frame.windows.sigma)
    weight = frame.usable / (DARK + np.maximum(refined.predicted, 0)) ** 2
    weight = _thinned(weight * robust_weight(frame, refined.predicted, refined.scale))
    light, q = _thinned(frame.view.light), _thinned(refined.q)
    sums = [_mean(weight), _mean(weight * light), _mean(weight * light * light)]
    shifts = np.concatenate([np.zeros((1, 2), np.float32), alternative_shifts(frame.pattern)])
    for shift in shifts:
        value = frame.pattern.brightness(q + shift, refined.blur)
        sums += [_mean(weight * value), _mean(weight * value**2), _mean(weight * value * light)]
    m = windows.moments(sums)
    correlations = [
        _correlation(*(m.of(0, i) for i in (0, 1, 2, 3 * k + 3, 3 * k + 4, 3 * k + 5)))
        for k in range(len(shifts))
    ]
    best = (
        np.max(correlations[1:], 0) if len(correlations) > 1 else np.full_like(correlations[0], -1)
    )
    own, alternative = (
        c.reshape(windows.shape).astype(np.float32) for c in (correlations[0], best)
    )
    return own, alternative


def _thinned(field: Image) -> Image:
    """Return the middle rows of cells: a third of the pixels says enough under wide windows."""
    return np.ascontiguousarray(field[SIDE // 2 :: SIDE])


def _mean(field: Image) -> Image:
    """Return the mean (h, w) over each cell's part of a row."""
    parts = [field[:, k::SIDE] for k in range(SIDE)]
    return np.add.reduce(parts) / np.float32(SIDE)


def _correlation(
    w: NDArray, light: NDArray, light2: NDArray, value: NDArray, value2: NDArray, both: NDArray
) -> NDArray:
    """Return the zero-mean normalised correlation of light and pattern from weighted sums."""
    w = np.maximum(w, 1e-12)
    a, b = light2 - light**2 / w, value2 - value**2 / w
    c = both - light * value / w
    return c / np.sqrt(np.maximum(a * b, 1e-12 * w**2))

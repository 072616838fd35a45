"""Design effect of residuals: by how much their correlation multiplies the variance of means.

The term is of survey sampling (Kish 1965): the variance of a mean over a block, over what the same
values would have if they were independent. 1 for white noise; errors alike over blocks of n pixels
have n. Information that supposes independent pixels must be divided by it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from .structure import usable_weights

SHORTEST_PX = 4
"""Side of the smallest blocks, image pixels. Chosen: larger ones double from here."""
MIN_FILLED = 0.25
"""Share of a block that must be seen."""
CLIP = 5.0
"""Robust deviations at which a block's mean is cut off: one patch of slips must not stand for the
whole image."""
MIN_BLOCKS_TO_CLIP = 12
"""Fewer have no robust deviation to be cut off by. Chosen."""
SIGNIFICANCE = 1e-3
"""Probability with which white noise may be taken for correlated, at each length."""


@dataclass(frozen=True, eq=False)
class DesignEffect:
    """Design effects at all block lengths, ascending."""

    lengths: NDArray[np.int_]
    """(K,) sides of the square blocks, pixels; the last ones end at the image's border."""
    values: NDArray[np.float64]
    """(K, 2) by component of the residuals."""
    blocks: NDArray[np.float64]
    """(K,) independent blocks, as many as would cover the seen pixels."""

    @property
    def significant(self) -> NDArray[np.float64]:
        """(K, 2) values, 1 where white noise could have given as much."""
        limit = chdtri(self.blocks, SIGNIFICANCE) / self.blocks
        return np.where(self.values > np.maximum(limit, 1)[:, None], self.values, 1.0)

    @property
    def largest(self) -> float:
        """The largest significant value of any length and component, at least 1."""
        return float(self.significant.max(initial=1.0))


def design_effect(
    residuals: NDArray[np.floating], weights: NDArray[np.floating] | None = None
) -> DesignEffect:
    """Return the design effect of residuals (H, W, 2) at block lengths up to the image.

    With a = w r the value at a length is the mean over blocks of (sum a)^2 over that of sum a^2.
    For symmetric noise that is independent from pixel to pixel it is 1 in expectation, whatever
    mask, weights and local variances. Blocks overlap by half.

    Args:
        residuals: NaN = missing.
        weights: (H, W) of the robust loss, 0 to 1; 1 where absent.
    """
    w = usable_weights(residuals, weights)
    a = w[..., None] * np.where(w[..., None] > 0, residuals, 0.0)
    sums, squares, counts = (_integral(v) for v in (a, a * a, (w > 0)[..., None].astype(float)))
    rows: list[tuple[int, NDArray[np.float64], float]] = []
    for length in _lengths(max(w.shape)):
        area = float(min(length, w.shape[0]) * min(length, w.shape[1]))
        filled = _block_sums(counts, length)[:, 0] >= MIN_FILLED * area
        if filled.any():
            pair = _block_sums(sums, length)[filled], _block_sums(squares, length)[filled]
            rows.append((length, _ratio(*pair), max((w > 0).sum() / area, 1.0)))
    lengths, values, blocks = zip(*rows, strict=True) if rows else ((), np.empty((0, 2)), ())
    return DesignEffect(np.array(lengths, int), np.array(values), np.array(blocks, float))


def _ratio(sums: NDArray[np.float64], squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of sums^2 over that of squares, (B, 2) each, with far blocks cut off."""
    square = sums**2
    if len(sums) >= MIN_BLOCKS_TO_CLIP:
        relative = square / np.maximum(squares.mean(0), 1e-300)
        limit = CLIP**2 * np.median(relative, axis=0) / chdtri(1, 0.5)
        square = np.minimum(relative, limit) * squares.mean(0)
    return square.mean(0) / np.maximum(squares.mean(0), 1e-300)


def _lengths(longest: int) -> Iterator[int]:
    """Yield block lengths, each twice the one before, and the image's longer side."""
    length = SHORTEST_PX
    while length < longest:
        yield length
        length *= 2
    yield longest


def _integral(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the summed-area table (H + 1, W + 1, C)."""
    return np.pad(values.cumsum(0).cumsum(1), ((1, 0), (1, 0), (0, 0)))


def _block_sums(table: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Return the sums (B, C) over blocks that overlap by half and tile the image."""
    (top, bottom), (left, right) = (_edges(n - 1, length) for n in table.shape[:2])
    rows = table[bottom] - table[top]
    return (rows[:, right] - rows[:, left]).reshape(-1, table.shape[2])


def _edges(size: int, length: int) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return first and last edges of blocks along one side, evenly spread over all of it."""
    length = min(length, size)
    count = 1 + int(np.ceil((size - length) / max(length / 2, 1)))
    first = np.round(np.linspace(0, size - length, count)).astype(int)
    return first, first + length

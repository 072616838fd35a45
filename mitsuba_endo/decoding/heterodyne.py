"""Unwrapping phases of several periods none of which spans the pattern.

Places that have the same phase of the finest period differ in those of the others: the one whose
phases fit best is taken, if it fits better than any other can (C. Zuo et al., "Temporal phase
unwrapping algorithms", Optics and Lasers in Engineering 85 (2016), section 3).
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

CERTAIN = 0.4
"""Largest misfit over the least distance between two places: from a half on, another may fit as
well."""


def separation(periods: Sequence[float], extent: float) -> float:
    """Return the least distance between the phases of two places, turns; 0 of one period.

    Args:
        periods: pattern pixels; places with the same phase of the last one are compared.
        extent: of the pattern, pixels.
    """
    finest, others = periods[-1], np.array(periods[:-1])
    apart = finest * np.arange(1, math.ceil(extent / finest))
    if not len(others):
        return 0.0
    return float(np.linalg.norm(_wrapped(apart[:, None] / others), axis=1).min(initial=0.5))


def unwrap(
    wrapped: Sequence[NDArray[np.float32]], periods: Sequence[float], extent: float
) -> NDArray[np.float32]:
    """Return the coordinate (...) that fits all phases; NaN where none is certain.

    Args:
        wrapped: (...) coordinate modulo each period, pattern pixels, NaN = not known.
        periods: pattern pixels.
        extent: of the pattern, pixels.
    """
    finest = periods[-1]
    limit = (CERTAIN * separation(periods, extent)) ** 2
    best = np.full(wrapped[-1].shape, np.float32(limit))
    q = np.full(best.shape, np.float32(np.nan))
    for fringe in range(-1, int(extent / finest) + 2):
        here = wrapped[-1] + np.float32(fringe * finest)
        misfit = np.zeros_like(best)
        for other, period in zip(wrapped[:-1], periods[:-1], strict=True):
            misfit += _wrapped((here - other) / np.float32(period)) ** 2
        inside = (here >= -0.5) & (here <= extent - 0.5)
        better = inside & (misfit < best)
        best[better], q[better] = misfit[better], here[better]
    return q


def bias(
    q: NDArray[np.float32], wrapped: Sequence[NDArray[np.float32]], periods: Sequence[float]
) -> float:
    """Return the largest mean misfit of a period, turns; infinite where nothing is known."""
    finite = np.isfinite(q)
    if not finite.any():
        return np.inf
    return max(
        abs(float(_wrapped((q - other)[finite] / period).mean()))
        for other, period in zip(wrapped[:-1], periods[:-1], strict=True)
    )


def _wrapped(turns: NDArray[np.floating]) -> NDArray[np.floating]:
    return turns - np.round(turns)

"""Whether coordinates make sense: smooth, within the pattern, and not mirrored."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LAGS = (2, 3, 5, 7, 11)
"""Samples between the three of a difference. The second best counts: at small ones rounding hides
how coordinates grow, and a wrong map may repeat itself at one, but not at two without a common
divisor."""
ROUNDED = 1.5
"""Stripes by which a second difference may differ: each coordinate is rounded to a stripe."""
BENT = 0.05
"""Share of the first difference by which the second may differ: perspective and curvature."""
BEYOND = 0.02
"""Of the samples that may lie beyond the pattern."""


@dataclass(frozen=True, eq=False)
class AxisMap:
    """One coordinate of the samples."""

    q: NDArray[np.float32]
    """(T, h, w) pattern pixels, NaN = missing, infinite = beyond the pattern."""
    width: NDArray[np.float32]
    """(T, h, w) pattern pixels that it is rounded to."""
    steps: dict[int, "_Steps"]
    """By lag; none if too many samples lie beyond the pattern."""
    share: float
    """Of the lit samples whose coordinate is smooth, at the best lag."""

    @classmethod
    def of(
        cls, q: NDArray[np.float32], width: NDArray[np.float32], lit: NDArray[np.bool_]
    ) -> "AxisMap":
        """Return the map with its differences."""
        if not lit.any() or (lit & np.isinf(q)).sum() > BEYOND * lit.sum():
            return cls(q, width, {}, 0.0)
        finite = np.where(np.isfinite(q), q, np.float32(np.nan))
        lags = [lag for lag in LAGS if 2 * lag < min(q.shape[1:])]
        steps = {lag: _differences(finite, width, lag) for lag in lags}
        shares = [step.smooth[_middle(lit, lag)].mean() for lag, step in steps.items()]
        return cls(q, width, steps, _second_best(shares))


def _second_best(shares: Sequence[float]) -> float:
    """Return the second largest number; of none or one, that or zero. NaN is zero."""
    ranked = sorted(np.nan_to_num(list(shares)).tolist(), reverse=True)
    return ranked[min(1, len(ranked) - 1)] if ranked else 0.0


@dataclass(frozen=True, eq=False)
class _Steps:
    by_x: NDArray[np.floating]
    """Half the difference of the samples to the right and to the left."""
    by_y: NDArray[np.floating]
    smooth: NDArray[np.bool_]
    """Second differences are those of rounding, perspective and curvature."""


def _middle(values: NDArray[Any], lag: int) -> NDArray[Any]:
    return values[:, lag:-lag, lag:-lag]


def _differences(q: NDArray[np.float32], width: NDArray[np.float32], lag: int) -> _Steps:
    here, right, left, below, above = _cross(q, lag)
    by_x, by_y = (right - left) / 2, (below - above) / 2
    rounded = ROUNDED * np.maximum.reduce(_cross(width, lag))
    limit = rounded + BENT * np.maximum(np.abs(by_x), np.abs(by_y))
    bend = np.maximum(np.abs(right - 2 * here + left), np.abs(below - 2 * here + above))
    return _Steps(by_x, by_y, bend <= limit)


def _cross(values: NDArray[np.float32], lag: int) -> list[NDArray[np.float32]]:
    """Return the samples and those to the right, left, below and above."""
    middle, ahead, behind = slice(lag, -lag), slice(2 * lag, None), slice(None, -2 * lag)
    crops = (
        (middle, middle),
        (middle, ahead),
        (middle, behind),
        (ahead, middle),
        (behind, middle),
    )
    return [values[:, rows, columns] for rows, columns in crops]


@dataclass(frozen=True, eq=False)
class SampleMap:
    q: NDArray[np.float32]
    """(T, h, w, 2)"""
    width: NDArray[np.float32]
    """(T, h, w)"""
    share: float
    """Of the lit samples that are smooth and not mirrored, at the best lag."""
    mirrored: float
    """Of those that are smooth and mirrored."""


def joined(axes: Sequence[AxisMap], lit: NDArray[np.bool_]) -> SampleMap:
    x, y = axes
    shares, mirrored = [], []
    for lag in x.steps.keys() & y.steps.keys():
        a, b = x.steps[lag], y.steps[lag]
        upright = a.by_x * b.by_y - a.by_y * b.by_x > 0
        smooth = a.smooth & b.smooth
        shares.append(float((smooth & upright)[_middle(lit, lag)].mean()))
        mirrored.append(float((smooth & ~upright)[_middle(lit, lag)].mean()))
    return SampleMap(
        np.stack([x.q, y.q], -1), np.maximum(x.width, y.width), _second_best(shares),
        _second_best(mirrored),
    )  # fmt: skip

"""A metric that may be unknown, with the reason, and means of several."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Metric:
    """A number, or the reason why there is none."""

    value: float | None
    reason: str | None = None

    @classmethod
    def unknown(cls, reason: str) -> "Metric":
        return cls(None, reason)


def rms(metrics: Sequence[Metric], names: Sequence[str]) -> Metric:
    """Return the root mean square over the frames that have a value; the reason names the rest."""
    values = [f.value for f in metrics if f.value is not None]
    missing = [(n, f.reason) for n, f in zip(names, metrics, strict=True) if f.value is None]
    reason = f"frame {missing[0][0]}: {missing[0][1]}" if missing else None
    if not values:
        return Metric.unknown(reason or "there are no frames")
    if missing:
        reason = f"over {len(values)} of {len(metrics)} frames ({reason})"
    return Metric(root_mean_square(values), reason)


def root_mean_square(values: ArrayLike) -> float:
    """Return the root of the mean square of numbers, any shape but empty, in their unit."""
    return float(np.sqrt(np.mean(np.square(values))))

"""What a sequence measured, in words."""

from collections.abc import Sequence

import numpy as np

from ..records.solution import INTERVAL, Estimate
from ..records.trajectory import FrameRow
from .epipolar_focal import FocalSum

SHOWN = 5
"""Lost frames that are named; the table of frames has all."""


def told(rows: Sequence[FrameRow], adjusted: Sequence[bool], focal: Estimate) -> list[str]:
    """Return sentences on tracking, on parts if there are several, and on the focal length.

    Args:
        rows: all frames.
        adjusted: of each part, whether its frames were adjusted together.
        focal: of the projector.
    """
    parts = len(adjusted)
    lost = [row for row in rows if row.lost]
    sentences = [f"{len(rows) - len(lost)} of {len(rows)} frames were placed.{_named(lost)}"]
    if parts > 1:
        sentences.append(
            f"The sequence falls into {parts} parts that do not overlap; each has a world of its "
            "own, and how they lie to one another is not known."
        )
    if isinstance(focal.value, float) and isinstance(focal.std, float):
        sentences.append(
            f"The focal length is {focal.value:.2f} +- {INTERVAL * focal.std:.2f} px, the same in "
            "all frames."
        )
    if not all(adjusted):
        sentences.append(
            f"{'Poses' if parts == 1 else 'Poses of some parts'} are as they were tracked: too few "
            "frames show the same surface to adjust them together."
        )
    return sentences


def _named(lost: Sequence[FrameRow]) -> str:
    if not lost:
        return ""
    named = "; ".join(f"{row.name}: {row.lost}" for row in lost[:SHOWN])
    more = f"; and {len(lost) - SHOWN} more" if len(lost) > SHOWN else ""
    return f" Lost: {named}{more}."


def focal_warning(first: FocalSum, all_: FocalSum) -> list[str]:
    """Warn where the frames that were placed ask for another focal length than was held."""
    spread = float(np.hypot(first.std, all_.std))
    if not np.isfinite(spread) or abs(all_.change) <= 3 * spread:
        return []
    return [
        f"all frames together ask for a focal length that differs by {100 * all_.change:+.2f} % "
        "from that of the first ones, by more than noise makes: does the projector's lens or the "
        "camera's zoom change?"
    ]

"""Frames that show the same: they average noise and bring no other view of the unknowns."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..records.correspondence import CorrespondenceMap

_SMALL_SHARE = 0.01
"""Median change of the coordinates, relative to what a map spans, below which two maps are alike:
camera, projector and surface then stand as before, to about a hundredth."""
_NOISE = 3.0
"""A median change within this many standard deviations of the noise cannot be told from it."""
_COMMON_SHARE = 0.5
"""Share of the smaller map that both must hold to be compared."""


def alike(a: CorrespondenceMap, b: CorrespondenceMap, noise_px: float) -> bool:
    """Tell whether two maps show the same view.

    Args:
        a: one map.
        b: another one of the same size.
        noise_px: standard deviation of one coordinate, pattern pixels.
    """
    both = a.valid & b.valid
    if both.sum() < _COMMON_SHARE * min(a.valid.sum(), b.valid.sum()) or not both.any():
        return False
    change = np.linalg.norm(a.q[both] - b.q[both], axis=-1)
    span = np.ptp(np.percentile(a.q[both], [10, 90], axis=0), axis=0).max()
    return bool(np.median(change) < max(_SMALL_SHARE * float(span), _NOISE * noise_px))


def redundancy_warnings(maps: Sequence[CorrespondenceMap], noise_px: float) -> list[str]:
    """Return a sentence for every frame that repeats an earlier one."""
    out: dict[str, str] = {}
    for first, second in combinations(maps, 2):
        if first.name not in out and second.name not in out and alike(first, second, noise_px):
            out[second.name] = (
                f"frames {first.name} and {second.name} are nearly identical: together they hold "
                "no more information than one, apart from averaged noise; move between captures"
            )
    return list(out.values())

"""Whether frames that were joined see one surface: a wrong one ruins the others silently.

A frame that is in its right place fits the common surface as well as one of its own. Compared are
the correspondences that meet the surface where other frames support it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .joint import FrameStart
from .optimum import Optimum
from .surface_result import USED_WEIGHT

_SUPPORT = 1.0
"""Robust weight of other frames around a vertex from which on they support it."""
_DOUBTFUL, _WRONG = 1.3, 1.8
"""Residuals on the common surface, relative to those of the frame alone, from which on its place
is in doubt or wrong. Right frames reach 1.05 on a sheet and 1.2 between the folds of a colon,
which one surface seen from the first camera cannot show whole."""
_LEAST_COMMON = 0.25
"""Share of a frame that others must see: over a small part, wrong places fit as well as the right
one (found at 0.15 to 0.2 in frames that have nothing in common)."""
_MORE_OUTLIERS = 0.35
"""Rise of the share of outliers that a right place does not cause; folds cause up to 0.2."""


@dataclass(frozen=True)
class Agreement:
    """How well one frame agrees with the others."""

    name: str
    common: float
    """Share of its correspondences where other frames see the surface too."""
    ratio: float
    """Median residual of those in the joint solution over that of the frame alone."""
    outliers: float
    """Share of outliers among those, beyond the frame's own share."""

    @property
    def wrong(self) -> bool:
        """Whether the frame must be left out."""
        return self.stray or self.ratio > _WRONG or self.outliers > _MORE_OUTLIERS

    @property
    def stray(self) -> bool:
        """Whether too little ties the frame to the others."""
        return self.common < _LEAST_COMMON

    @property
    def doubtful(self) -> bool:
        return self.ratio > _DOUBTFUL

    @property
    def reason(self) -> str:
        if self.stray:
            return (
                f"other frames see only {100 * self.common:.0f} % of it, too little to be sure of "
                "its place"
            )
        return (
            f"it does not fit the surface of the other frames: residuals there are "
            f"{self.ratio:.2g} times those of the frame alone, {100 * self.common:.0f} % of it is "
            "seen by others"
        )


def agreements(alone: list[FrameStart], optimum: Optimum) -> list[Agreement]:
    """Return the agreement of every frame of a joint optimum, in order.

    Args:
        alone: the frames solved alone.
        optimum: of all of them with one surface.
    """
    own = [optimum.support(k) for k in range(len(alone))]
    total = np.sum(own, axis=0)
    return [_agreement(a, optimum, k, total - own[k]) for k, a in enumerate(alone)]


def worst(found: list[Agreement]) -> int | None:
    """Return the index of the most clearly wrong frame, or None."""
    wrong = [k for k, a in enumerate(found) if a.wrong]
    return max(wrong, key=lambda k: (found[k].stray, found[k].ratio), default=None)


def _agreement(
    alone: FrameStart, optimum: Optimum, frame: int, others: NDArray[np.float64]
) -> Agreement:
    at, lattice = optimum.evaluation, optimum.objective.problem.surfaces[0].lattice
    supported = np.all(others[lattice.faces] >= _SUPPORT, axis=1)
    common = at.hits[frame] & supported[at.faces[frame]]
    if not common.any():
        return Agreement(alone.name, 0.0, np.inf, 0.0)
    before, after = alone.squared, optimum.evaluation.squared(frame)
    ratio = np.sqrt(np.nanmedian(after[common]) / np.nanmedian(before[common]))
    lost = alone.used & (optimum.weights[frame] <= USED_WEIGHT)
    return Agreement(alone.name, float(common.mean()), float(ratio), float(lost[common].mean()))

"""Whether frames that were joined see one surface: a wrong one ruins the others silently.

A frame that is in its right place fits the common surface as well as one of its own. Compared are
the correspondences that meet the surface where other frames support it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from ...geometry.transforms import RigidTransform
from ..optimise.optimum import Optimum
from ..optimise.rendered import USED_WEIGHT
from ..statistics.observability import unknowns
from ..unknowns.plan import Plan
from ..unknowns.state import INTRINSICS, State
from .joint import FrameStart, single_plan

_SUPPORT = 1.0
"""Robust weight of other frames around a vertex from which on they support it."""
_DOUBTFUL, _WRONG = 1.3, 1.8
"""Residuals on the common surface, relative to those of the frame alone, from which on its place
is in doubt or wrong. Right frames reach 1.05 on a sheet and 1.2 between the folds of a colon,
which one surface seen from the first camera cannot show whole."""
_LEAST_COMMON = 0.25
"""Share of a frame that others must see: over a small part, wrong places fit as well as the right
one (found at 0.15 to 0.2 in frames that have nothing in common)."""
_RARE = 1e-3
"""Probability of a frame's own calibration below which noise does not explain that it differs from
the joint one. Between folds model errors reach 0.03; wrong places on a sheet were seen at 1e-9."""
_OWN_STD = 0.0025
"""Standard deviation, in natural scales, up to which what a frame says alone is compared: what it
knows worse depends on noise that passes for relief."""
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
    chance: float = 1.0
    """Probability that noise alone moves the projector pose and focal length that the frame gives
    alone so far from those of the joint solution."""

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
        return self.ratio > _DOUBTFUL or self.chance < _RARE

    @property
    def reason(self) -> str:
        if self.stray:
            return (
                f"other frames see only {100 * self.common:.0f} % of it, too little to be sure of "
                "its place"
            )
        if self.ratio <= _DOUBTFUL and self.chance < _RARE:
            return (
                "alone it gives another projector pose or focal length than with the others, by "
                f"more than noise makes (probability {self.chance:.0e}): its place may be wrong"
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
    return Agreement(
        alone.name, float(common.mean()), float(ratio), float(lost[common].mean()),
        chance(alone, optimum, frame),
    )  # fmt: skip


def chance(alone: FrameStart, optimum: Optimum, frame: int) -> float:
    """Return the probability that noise separates a frame's own calibration from the joint one.

    The difference of an estimate and a better one that contains it varies by no more than the
    first alone (Hausman 1978): its square in those variances is at most chi-square distributed.
    """
    plan = single_plan(optimum.objective.problem.plan)
    if not plan.columns:
        return 1.0
    own = State([np.ones(1)], [RigidTransform.identity()], [alone.projector_from_camera],
                [alone.intrinsics])  # fmt: skip
    scale = np.array([u.scale for u in unknowns(plan, own)])
    values, vectors = np.linalg.eigh(alone.information * np.outer(scale, scale))
    known = values > _OWN_STD**-2
    moved = _difference(plan, own, optimum.state, frame) / scale
    along = np.sqrt(values[known]) * (vectors.T[known] @ moved)
    return float(chi2.sf(along @ along, max(int(known.sum()), 1)))


def _difference(plan: Plan, own: State, joint: State, frame: int) -> NDArray[np.float64]:
    """Return joint minus own calibration of a frame (G,) in the chart of the frame alone."""
    out = np.zeros(plan.columns)
    for (name, _), slot in plan.slots.items():
        if name == "projector_pose":
            a, b = own.projector_from_camera[0], joint.projector_from_camera[frame]
            turned = Rotation.from_matrix(b.R @ a.R.T).as_rotvec()
            # The unit of length is not the same: directions are compared.
            length = np.linalg.norm(a.t)
            moved = length * b.t / np.linalg.norm(b.t) - a.t
            step = np.concatenate([turned, moved])
            out[slot] = plan.chart(own, name, 0).T @ step
        else:
            part = INTRINSICS[name]
            out[slot] = (joint.intrinsics[frame] - own.intrinsics[0])[part][
                : slot.stop - slot.start
            ]
    return out

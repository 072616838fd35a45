"""Whether frames that were joined see one surface: a wrong one ruins the others silently.

A frame that is in its right place fits the common surface as well as one of its own. Compared are
the correspondences that meet the surface where other frames support it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from ...geometry.transforms import RigidTransform
from ..minimisers.result import USED_WEIGHT, OptimisationResult
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .fit import FrameSolution
from .observability import unknowns

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

_ENOUGH = 4
"""Frames from which most of them can accuse the plan: of fewer one wrong frame may be half."""
_MOST_LEFT_OUT = 0.1
"""Share of the frames after which those that still contradict accuse the plan instead."""


@dataclass(frozen=True)
class Consistency:
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


def consistencies(alone: list[FrameSolution], result: OptimisationResult) -> list[Consistency]:
    """Return the agreement of every frame of a joint result, in order.

    Args:
        alone: the frames solved alone.
        result: of all of them with one surface.
    """
    own = [result.support(k) for k in range(len(alone))]
    total = np.sum(own, axis=0)
    return [_consistency(a, result, k, total - own[k]) for k, a in enumerate(alone)]


def doubtful_frames(agreements: list[Consistency]) -> list[str]:
    """Return warnings of the frames that fit badly, each with what to do.

    Where most frames fit the common surface worse than alone, none of them is the wrong one: alone
    a frame's surface takes up what its decoder's errors have in common, or the surface moved.
    """
    doubtful = [a for a in agreements if a.doubtful]
    ratios = [a.ratio for a in doubtful if a.ratio > _DOUBTFUL]
    if len(agreements) > 2 and len(ratios) > len(agreements) / 2:
        return [
            f"{len(ratios)} of {len(agreements)} frames fit the common surface "
            f"{min(ratios):.2g} to {max(ratios):.2g} times worse than each a surface of its own, "
            "as maps do whose errors are alike over many pixels, or surfaces that moved; "
            "if yours may have moved, compare with --share surface=per_frame"
        ]
    return [_doubt(a, first=a is agreements[0], several=len(agreements) > 2) for a in doubtful]


def _doubt(frame: Consistency, *, first: bool, several: bool) -> str:
    said = f"do not rely on frame {frame.name}: {frame.reason}"
    if not several:
        return f"{said}; capture a third frame to tell which of the two is wrong"
    if first:
        return f"{said}; the other poses are told from its camera, so calibrate without it"
    return f"{said}; calibrate without it if you need the others' best values"


def plan_refuted(agreements: list[Consistency], layout: Layout, left_out: int) -> str:
    """Say that the sharing plan is wrong where most frames contradict it, else nothing.

    One frame that does not belong to the others is left out and the rest solved again; where the
    plan ties what moved, that would go on to the last frame, a joint solution each time.

    Args:
        agreements: of every frame with the joint solution.
        layout: with the plan.
        left_out: frames that were left out before.
    """
    count = len(agreements) + left_out
    contradicting = [a for a in agreements if a.wrong and not a.stray]
    tied = layout.sharing("projector_pose") != "per_frame"
    many = len(contradicting) > len(agreements) / 2 or left_out >= count * _MOST_LEFT_OUT
    if not (tied and contradicting and count >= _ENOUGH and many):
        return ""
    ratio = np.median([a.ratio for a in contradicting])
    return (
        f"with one projector pose for all, {left_out + len(contradicting)} of "
        f"{count} frames contradict the others (residuals {ratio:.2g} times those alone); do not "
        "trust the values, and calibrate with --share projector_pose=per_frame"
    )


def worst(agreements: list[Consistency]) -> int | None:
    """Return the index of the most clearly wrong frame, or None."""
    wrong = [k for k, a in enumerate(agreements) if a.wrong]
    return max(wrong, key=lambda k: (agreements[k].stray, agreements[k].ratio), default=None)


def _consistency(
    alone: FrameSolution, result: OptimisationResult, frame: int, others: NDArray[np.float64]
) -> Consistency:
    at, surface = result.evaluation.frames[frame], result.problem.surface_seen_by(frame)
    supported = np.all(others[surface.faces] >= _SUPPORT, axis=1)
    common = at.hits & supported[at.faces]
    if not common.any():
        return Consistency(alone.name, 0.0, np.inf, 0.0)
    ratio = np.sqrt(np.nanmedian(at.squared[common]) / np.nanmedian(alone.squared[common]))
    lost = alone.used & (result.weights[frame] <= USED_WEIGHT)
    return Consistency(
        alone.name, float(common.mean()), float(ratio), float(lost[common].mean()),
        chance(alone, result, frame),
    )  # fmt: skip


def chance(alone: FrameSolution, result: OptimisationResult, frame: int) -> float:
    """Return the probability that noise separates a frame's own calibration from the joint one.

    The difference of an estimate and a better one that contains it varies by no more than the
    first alone (Hausman 1978): its square in those variances is at most chi-square distributed.
    """
    layout = result.problem.layout.alone()
    if not layout.columns:
        return 1.0
    own = alone.state
    scale = np.array([u.scale for u in unknowns(layout, own, 1.0)])
    values, vectors = np.linalg.eigh(alone.information * np.outer(scale, scale))
    determined = values > _OWN_STD**-2
    joint = _in_own_unit(layout, own, result.state, frame)
    moved = layout.difference(own, joint) / scale
    along = np.sqrt(values[determined]) * (vectors.T[determined] @ moved)
    return float(chdtrc(max(int(determined.sum()), 1), along @ along))


def _in_own_unit(layout: Layout, own: State, joint: State, frame: int) -> State:
    """Return a frame's part of a joint state in the unit of length that it has alone."""
    values = {name: (joint.at(name, frame),) for name in layout.owners}
    pose, length = joint.at("projector_pose", frame), np.linalg.norm(own.at("projector_pose", 0).t)
    values["projector_pose"] = (RigidTransform(pose.R, length * pose.t / np.linalg.norm(pose.t)),)
    return State(own.surfaces, values, own.owners)

"""How well two range images agree under one placement, and whether that can be trusted."""

from dataclasses import dataclass, field, replace

import numpy as np

from mitsuba_endo.robust import robust_std

from .icp import Match, jacobian, match, sample
from .range_image import RangePyramid
from .similarity import Similarities

# The gate. On 240 neighbouring pairs of random sheets, stomachs and colons right placements have a
# residual up to 0.005 and a runner-up at 1.8 to 60 times the score; wrong ones, and 240 pairs of
# unrelated surfaces, have residuals mostly from 0.006 and runner-ups at 1.0 to 1.7 times.
GATE_SCALE = 0.02
"""Scale of the loss when placements are judged: points 4 mm off at 70 mm are not partners."""
MAX_RESIDUAL = 0.008
"""Relative to the typical range; see above: between right and wrong placements."""
MIN_RUNNER_UP = 1.7
"""Score of the next placement over that of the best; see above."""
MIN_OVERLAP = 0.3
"""Sum of the shares of either frame's points that have a partner in the other."""
MAX_DISAGREEMENT = 0.4
"""Share of the points in common view without a partner: hidden behind folds, or a wrong match."""
MAX_WEAKNESS = 0.02
"""Standard deviation in the worst-determined direction, radians or relative to the range."""
JUDGED_POINTS = 2500
"""Points of a frame on which placements are judged. Chosen."""
INDEPENDENT_POINTS = 100
"""Residuals are smooth: an image counts as about this many independent ones."""

NO_OVERLAP = "no placement makes it overlap"
POOR_FIT = "no placement fits"
FLAT = "the overlap is too flat or symmetric to fix the frame's motion"
AMBIGUOUS = "another placement fits about as well (overlap too small, flat or repetitive)"


@dataclass(frozen=True, eq=False)
class RegistrationQuality:
    """How well two frames agree under one placement, taken over both directions."""

    residual: float
    """Robust standard deviation of the point-to-plane distance, relative to the typical range."""
    overlap: tuple[float, float]
    """Shares of the source's and of the target's points that have a partner."""
    disagreement: float
    """Share of the points in common view that have none."""
    in_view: float
    """Share of either frame's points where the other sees something, the mean of both."""
    weakness: float
    """Standard deviation of the placement in its worst-determined direction."""

    @property
    def fault(self) -> str:
        """Why the placement cannot be trusted; empty if it can, as far as it alone tells."""
        if sum(self.overlap) < MIN_OVERLAP:
            return NO_OVERLAP
        if not (self.residual <= MAX_RESIDUAL and self.disagreement <= MAX_DISAGREEMENT):
            return POOR_FIT
        return "" if self.weakness <= MAX_WEAKNESS else FLAT


@dataclass(frozen=True, eq=False)
class PairRegistration:
    """The best placement of a source frame in a target frame."""

    target_from_source: Similarities = field(default_factory=Similarities.identity)
    """One transform, in the common unit."""
    fit: RegistrationQuality = field(
        default_factory=lambda: RegistrationQuality(np.inf, (0.0, 0.0), 1.0, 0.0, np.inf)
    )
    runner_up: float = 1.0
    """Score of the next distinct placement over that of the best one, at least 1."""

    @property
    def fault(self) -> str:
        """Why the placement cannot be trusted; empty if it can."""
        return self.fit.fault or ("" if self.runner_up >= MIN_RUNNER_UP else AMBIGUOUS)

    def inverse(self) -> "PairRegistration":
        """Return the placement of the target in the source."""
        fit = replace(self.fit, overlap=self.fit.overlap[::-1])
        return PairRegistration(self.target_from_source.inverse(), fit, self.runner_up)


def judge(
    pose: Similarities, target: RangePyramid, source: RangePyramid, rng: np.random.Generator
) -> RegistrationQuality:
    """Compare the two frames under one placement, in both directions."""
    there = match(pose, sample(source.fine, JUDGED_POINTS, rng), target.fine, GATE_SCALE)
    back = match(pose.inverse(), sample(target.fine, JUDGED_POINTS, rng), source.fine, GATE_SCALE)
    residual = max(_residual(there), _residual(back))
    partners = there.partner.sum() + back.partner.sum()
    in_view = there.in_view.sum() + back.in_view.sum()
    return RegistrationQuality(
        residual,
        (float(there.partner.mean()), float(back.partner.mean())),
        1 - float(partners) / max(float(in_view), 1.0),
        float(there.in_view.mean() + back.in_view.mean()) / 2,
        _weakness(there, residual),
    )


def _residual(matches: Match) -> float:
    """Return the robust standard deviation; points in common view without partner are far."""
    distance = np.where(matches.partner, matches.residual, 1.0)[matches.in_view]
    return robust_std(distance) if distance.size else np.inf


def _weakness(matches: Match, residual: float) -> float:
    """Return the standard deviation of the placement in its worst-determined direction.

    Noise in the normals makes even a plane look informative in J^T J. The noises of source and
    target are independent, so the cross product J_target^T J_source is free of it on average.
    """
    at = matches.partner[0]
    if at.sum() < 10:
        return np.inf
    moved, weight = matches.moved[:, at], matches.weight[0, at, None]
    ahead, _ = jacobian(moved, matches.normals[:, at])
    behind, _ = jacobian(moved, matches.source_normals[:, at])
    cross = (weight * ahead[0]).T @ (weight * behind[0]) / (weight**2).sum()
    least = float(np.linalg.eigvalsh((cross + cross.T) / 2)[0])
    return residual / np.sqrt(INDEPENDENT_POINTS * least) if least > 0 else np.inf

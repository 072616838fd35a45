"""Refinement of proposals to minima of the epipolar cost, and the choice among them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.robust import robust_std

from .correspondences import Correspondences
from .epipolar_refinement import EpipolarLoss, EpipolarState, evaluate, minimise
from .relative_pose_ransac import facing, planar_poses, same_pose
from .result import Candidate
from .vectors import Vectors

GRADUATED_PX = (20.0, 5.0, 1.0)
"""Cauchy scales, pattern pixels, coarse to fine: a wide one bridges wrong starts, a narrow one
ignores outliers."""
REDESCENDING = 2.0
"""Geman-McClure scale of the finish over the robust residual scale: a Cauchy loss alone leaves
-0.3 to -0.5 % in f under 30 % outliers."""
MIN_IN_FRONT = 0.99
"""Share of a calibration's inliers in front of camera and projector. Chosen: noise may put some of
the farthest behind."""
MIN_SCALE_PX = 0.02
"""Least scale of residuals, pattern pixels: maps without noise would leave a loss without any.
Chosen: far below a decoder's noise."""
EXPLAINED = 1.5
"""Residuals within this many times the map's own noise are explained."""
HOPELESS = 4.0
"""Times the cost of a state that explains the data: not refined further."""
FINALISTS = 3
"""Minima of similar cost that are finished. Chosen: the best, a plane's twin, and one more."""
_PATIENT = 200
"""Steps towards a minimum that is reported; valleys of weak relief take a hundred."""
SIMILAR_COST = 1.2
"""Minima whose costs have at most this ratio are reported as a possible confusion."""
_STEADY_SCALE = 0.02
"""Relative change of the residuals' scale that ends its following. Chosen: far below its error."""
_SAME_ANGLE, _SAME_FOCAL = 0.01, 0.02
"""Radians and relative focal length within which two minima are one: steps end far below both."""


@dataclass(frozen=True)
class RefinementProblem:
    """What stays the same over all candidates."""

    projector: ProjectorModel
    refine_focal: bool
    focal_bounds: tuple[float, float]
    noise_px: float
    """Noise of q as the map itself shows it, pattern pixels (see ``clean.noise_scale``)."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """A calibration at a minimum of the cost on some sample."""

    state: EpipolarState
    in_front: float
    """Share of points not behind camera or projector."""
    cost: float = np.inf
    """See :class:`.result.Candidate`."""

    @property
    def candidate(self) -> Candidate:
        return Candidate(
            self.state.pose, float(self.state.projector.focal), self.cost, self.in_front
        )

    def same_as(self, other: "Minimum") -> bool:
        """Tell whether pose (0.01 radians) and focal length (2 %) are the same."""
        return _same(self.state, other.state)


def robust_scale(state: EpipolarState) -> float:
    """Return the robust standard deviation of the residuals, pattern pixels."""
    return max(MIN_SCALE_PX, robust_std(state.r))


def refine(
    problem: RefinementProblem,
    starts: Iterable[tuple[RigidTransform, float]],
    data: Correspondences,
) -> list[Minimum]:
    """Descend from every (pose, focal) under the graduated and then the redescending loss.

    Starts that have run into one another go on as one. The planar twin of the best minimum
    competes as well: on nearly planar data it fits about as well.

    Returns:
        The distinct minima with at least 99 % of the points in front, best first.
    """
    states = [evaluate(pose, problem.projector.with_(focal=focal), data) for pose, focal in starts]
    states = _graduated(problem, states, data, GRADUATED_PX)
    minima = _valid([_redescend(problem, s, data) for s in states], data)
    if not minima:
        return []
    best = minima[0].state
    alternatives = _graduated(
        problem, _alternatives(best, data), data, GRADUATED_PX[1:], alternative=best
    )
    redescended = [_redescend(problem, s, data) for s in alternatives]
    return ranked([*minima, *_valid(redescended, data)])


def finish(
    problem: RefinementProblem, minima: list[Minimum], data: Correspondences, more: Correspondences
) -> list[Minimum]:
    """Finish the best minimum, and those of similar cost, on a larger sample.

    In a valley several of these are on their way to one minimum: they go on to it first.

    Args:
        problem: what is to be found.
        minima: best first.
        data: the sample on which they were found.
        more: the larger one.
    """
    close, rest = _close(minima)
    if len(close) > 1:
        settled = [_redescend(problem, m.state, data, _PATIENT) for m in close]
        close, beaten = _close(_valid(settled, data))
        rest = [*beaten, *rest]
    finished = [_redescend(problem, _on(m.state, more), more, _PATIENT) for m in close[:FINALISTS]]
    return [*_valid(finished, more), *close[FINALISTS:], *rest]


def _close(minima: list[Minimum]) -> tuple[list[Minimum], list[Minimum]]:
    """Split minima, best first, into those whose cost is similar to the best one's and the rest."""
    limit = SIMILAR_COST * min((m.cost for m in minima), default=0.0)
    return [m for m in minima if m.cost <= limit], [m for m in minima if m.cost > limit]


def _graduated(
    problem: RefinementProblem,
    states: list[EpipolarState],
    data: Correspondences,
    scales: tuple[float, ...],
    alternative: EpipolarState | None = None,
) -> list[EpipolarState]:
    """Descend from all states through the Cauchy scales; merge and drop between the scales."""
    alternatives = [] if alternative is None else [alternative]
    for scale in scales:
        loss = EpipolarLoss(False, scale)
        states = [_descend(problem, s, data, loss) for s in states]
        states = _without_repeats(sorted(states, key=lambda s: loss.cost(s.r)))
        states = _competitive(problem, states, [*states, *alternatives], loss)
    return states


def _competitive(
    problem: RefinementProblem,
    states: list[EpipolarState],
    field: list[EpipolarState],
    loss: EpipolarLoss,
) -> list[EpipolarState]:
    """Drop hopeless states, but only once some state of ``field`` explains the data to the noise.

    Until then a high cost may just mean a long way to go.
    """
    costs = {id(s): loss.cost(s.r) for s in field}
    best = min(field, key=lambda s: costs[id(s)], default=None)
    if best is None or robust_scale(best) > EXPLAINED * problem.noise_px:
        return states
    return [s for s in states if costs[id(s)] <= HOPELESS * costs[id(best)]]


def _alternatives(best: EpipolarState, data: Correspondences) -> list[EpipolarState]:
    noise_angle = robust_scale(best) / best.projector.focal
    poses = [
        facing(pose, data, best.bearings, noise_angle)[0]
        for pose in planar_poses(data, best.bearings, 4 * noise_angle)
    ]
    return [
        evaluate(pose, best.projector, data, best.bearings)
        for pose in poses
        if not same_pose(pose, best.pose, 0.03)
    ]


def _valid(states: list[EpipolarState], data: Correspondences) -> list[Minimum]:
    minima = [_turned_to_front(s, data) for s in states]
    return ranked([m for m in minima if m.in_front >= MIN_IN_FRONT])


def _without_repeats(states: list[EpipolarState]) -> list[EpipolarState]:
    kept: list[EpipolarState] = []
    for s in states:
        if not any(_same(s, k) for k in kept):
            kept.append(s)
    return kept


def ranked(minima: list[Minimum]) -> list[Minimum]:
    """Return the distinct minima by cost under one Geman-McClure loss, that of the best scale.

    Costs that noise alone could put in either order are a tie (see :func:`cost_margin`); among
    those the smaller rotation comes first, since projectors look where their cameras do.
    """
    if not minima:
        return []
    scale = min(robust_scale(m.state) for m in minima)
    loss = EpipolarLoss(True, REDESCENDING * scale)
    rated = sorted(
        (Minimum(m.state, m.in_front, loss.cost(m.state.r) / scale**2) for m in minima),
        key=lambda m: m.cost,
    )
    distinct = _without_repeats([m.state for m in rated])
    kept = [m for m in rated if any(m.state is s for s in distinct)]
    best = kept[0]
    tied = {
        id(m)
        for m in kept
        if m.cost <= best.cost + cost_margin(best.state.r, m.state.r, loss, 1.0) / scale**2
    }
    return sorted(
        kept,
        key=lambda m: (id(m) not in tied, rotation_angle(m.state.pose.R) if id(m) in tied
                       else m.cost),
    )  # fmt: skip


def cost_margin(a: Vectors, b: Vectors, loss: EpipolarLoss, errors: float = 3.0) -> float:
    """Return the difference of mean loss that noise alone makes between two calibrations.

    Each feels the noise across its own epipolar lines, so even two exact poses differ by the
    standard error of the pointwise differences (Vuong 1989). Calibrations in one valley feel the
    same noise: there a chi-square difference of 9 counts.

    Args:
        a: (N,) residuals of one calibration, pattern pixels.
        b: (N,) of the other, at the same correspondences.
        errors: standard errors that count.
    """
    difference = loss.values(b) - loss.values(a)
    sigma2 = (loss.scale / REDESCENDING) ** 2
    return max(errors * float(difference.std()) / np.sqrt(len(a)), 4.5 * sigma2 / len(a))


def _descend(
    problem: RefinementProblem,
    state: EpipolarState,
    data: Correspondences,
    loss: EpipolarLoss,
    iterations: int = 20,
) -> EpipolarState:
    return minimise(
        state, data, loss, refine_focal=problem.refine_focal, focal_bounds=problem.focal_bounds,
        iterations=iterations,
    )  # fmt: skip


def _redescend(
    problem: RefinementProblem, state: EpipolarState, data: Correspondences, iterations: int = 20
) -> EpipolarState:
    """Alternate the residual scale and the minimum under it until the scale stays."""
    for _ in range(4):
        scale = robust_scale(state)
        state = _descend(problem, state, data, EpipolarLoss(True, REDESCENDING * scale), iterations)
        if abs(robust_scale(state) - scale) < _STEADY_SCALE * scale:
            break
    return state


def _on(state: EpipolarState, data: Correspondences) -> EpipolarState:
    return evaluate(state.pose, state.projector, data)


def _turned_to_front(state: EpipolarState, data: Correspondences) -> Minimum:
    """Return the minimum with the sign of t, which the residual does not feel, set by depth."""
    scale = robust_scale(state)
    near = np.abs(state.r) < 5 * scale
    inliers = data.take(near)
    pattern_bearings = state.bearings.take(near)
    pose, front = facing(state.pose, inliers, pattern_bearings, 3 * scale / state.projector.focal)
    return Minimum(evaluate(pose, state.projector, data, state.bearings), front)


def _same(a: EpipolarState, b: EpipolarState) -> bool:
    return (
        same_pose(a.pose, b.pose, _SAME_ANGLE)
        and abs(np.log(a.projector.focal / b.projector.focal)) < _SAME_FOCAL
    )

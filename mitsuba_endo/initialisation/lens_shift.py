"""Search over the centre of a projector whose lens is shifted, where nobody gave it.

Lens projectors have their principal point in the middle of the pattern's width and anywhere along
its height, often at the lower edge or below it, so that they can stand on a table. With the camera
known, one pair determines seven numbers: rotation, direction of translation, and two of focal
length and centre. So the height of the centre can be found beside the focal length, while its
place across cannot.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel

from .choose import MIN_SCALE_PX, REDESCENDING, RefinementProblem, refine, robust_scale
from .correspondences import (
    PROPOSE_POINTS,
    REFINE_POINTS,
    Correspondences,
    checked_map,
    gather,
    spread_sample,
)
from .epipolar_refinement import EpipolarLoss, EpipolarState, evaluate, minimise
from .outlier_rejection import clean_map, noise_scale
from .relative_pose_ransac import distinct, focal_lengths, propose
from .result import Start

HEIGHTS = (-0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25)
"""Centres tried first, of the pattern's height: lens shifts of up to 75 %, upwards or downwards."""
MIDDLE = 0.5
"""That of a lens without shift, of the pattern's height."""
FINALISTS = 2
"""Heights, best first, from which the descent starts. Chosen."""
CANDIDATES = 4
"""Poses refined at each centre."""
BETTER = 0.95
"""Scale of the residuals over that of the middle up to which another centre is believed: a right
middle loses less than 1 % to chance, the samples' paired spread."""
_REACH = (0.3, 0.1)
"""Of the pattern's height: how far each round of the descent looks to either side."""
_EVALUATIONS = 18
"""Heights tried in a round. A golden section needs 18 from 0.6 of 800 pattern pixels down to 0.1,
where it ends."""
_PATIENT = 60
"""Steps of pose and focal length at a height. Chosen: three times the usual."""


@dataclass(frozen=True, eq=False)
class FrameSamples:
    """Samples of one frame's correspondences."""

    few: Correspondences
    """To propose poses from."""
    some: Correspondences
    """To refine them on."""
    noise_px: float
    """See :class:`.choose.RefinementProblem`."""


@dataclass(frozen=True, eq=False)
class LensShift:
    """Where the projector's centre was looked for and found."""

    centre: tuple[float, float]
    """Pattern pixels; the middle of the pattern unless another is clearly better."""
    off_middle: bool
    """Whether another is."""
    scale_px: float
    """Robust scale of the residuals at the best centre, pattern pixels; the worst frame's."""
    middle_scale_px: float
    """The same at the middle; infinite where no pose is possible there."""
    states: list[EpipolarState]
    """The calibration of every frame at ``centre``; empty where none is possible."""


def is_explained(start: Start) -> bool:
    """Tell whether a start leaves no more than its map's own noise.

    Then no other centre than its own can be clearly better.
    """
    return BETTER * start.scale_px <= start.noise_px


def frame_samples(
    q: NDArray[np.floating], camera: CameraModel, rng: np.random.Generator
) -> FrameSamples:
    """Sample a map (H, W, 2), pattern pixels with NaN = missing.

    Raises:
        InputError: fewer than 50 usable correspondences, or a map of another size.
    """
    q = checked_map(q, camera)
    usable = clean_map(q)
    data = gather(q, usable, camera)
    few, some = (spread_sample(data, n, camera.width, rng) for n in (PROPOSE_POINTS, REFINE_POINTS))
    return FrameSamples(few, some, noise_scale(q, usable))


def find_lens_shift(
    frames: Sequence[FrameSamples],
    projector: ProjectorModel,
    size: tuple[int, int],
    *,
    refine_focal: bool = True,
    focal_guess: float | None = None,
) -> LensShift:
    """Find the height of the projector's centre that explains the frames best.

    Poses and focal length are searched anew at each of :data:`HEIGHTS`; from the best of these the
    height descends with everything else following. Frames share the centre alone.

    Args:
        frames: samples of each frame.
        projector: law, aspect and distortion, which must be right: an omitted distortion passes for
            a shift. Its centre is not used.
        size: pattern width and height, pixels.
        refine_focal: see :func:`.search.search_start`.
        focal_guess: see there.
    """
    width, height = size
    middle = ((width - 1) / 2, (height - 1) / 2)
    tried: dict[float, list[EpipolarState]] = {}
    for share in HEIGHTS:
        moved = projector.with_(centre=(middle[0], share * (height - 1)))
        states = [_best(f, moved, width, refine_focal, focal_guess) for f in frames]
        fitted = [s for s in states if s is not None]
        if len(fitted) == len(frames):
            tried[share] = fitted
    if not tried:
        return LensShift(middle, False, np.inf, np.inf, [])
    ranked = sorted(tried, key=lambda v: _scale(tried[v]))
    ends = [
        _descended(list(frames), tried[share], share, height, refine_focal)
        for share in ranked[:FINALISTS]
    ]
    settled = [_settled(frames, states, refine_focal) for states in ends]
    best = min([*(s for s in settled if s), tried[ranked[0]]], key=_scale)
    scale, there = _scale(best), _scale(tried[MIDDLE]) if MIDDLE in tried else np.inf
    off_middle = scale < BETTER * there
    y = float(best[0].projector.centre[1]) if off_middle else middle[1]
    states = best if off_middle else tried.get(MIDDLE, [])
    return LensShift((middle[0], y), off_middle, scale, there, states)


def _best(
    frame: FrameSamples,
    projector: ProjectorModel,
    width: int,
    refine_focal: bool,
    guess: float | None,
) -> EpipolarState | None:
    """Return the best calibration of a frame at one centre, None where there is none."""
    focals, bounds = focal_lengths(projector, width, frame.few, refine_focal, guess)
    proposals = distinct(propose(frame.few, projector, focals), CANDIDATES)
    problem = RefinementProblem(projector, refine_focal, bounds, frame.noise_px)
    minima = refine(problem, ((p.pose, p.focal) for p in proposals), frame.some)
    return minima[0].state if minima else None


def _descended(
    frames: list[FrameSamples],
    states: list[EpipolarState],
    share: float,
    height: int,
    refine_focal: bool,
) -> list[EpipolarState]:
    """Return the states at the best height near ``share``, poses and focal lengths following."""
    y = share * (height - 1)
    for reach in _REACH:
        descent = _Descent(frames, states, refine_focal)
        span = reach * height
        minimize_scalar(
            descent, bounds=(y - span, y + span), method="bounded",
            options={"xatol": 0.1, "maxiter": _EVALUATIONS},
        )  # fmt: skip
        states, y = descent.states, float(descent.states[0].projector.centre[1])
    return states


def _settled(
    frames: Sequence[FrameSamples], states: list[EpipolarState], refine_focal: bool
) -> list[EpipolarState]:
    """Return the minima next to the states; empty where points would lie behind the devices."""
    settled: list[EpipolarState] = []
    for frame, state in zip(frames, states, strict=True):
        focal = float(state.projector.focal)
        problem = RefinementProblem(
            state.projector, refine_focal, (focal / 2, 2 * focal), frame.noise_px
        )
        minima = refine(problem, [(state.pose, focal)], frame.some)
        if not minima:
            return []
        settled.append(minima[0].state)
    return settled


class _Descent:
    """Cost of a height, from the best states met so far."""

    def __init__(
        self, frames: list[FrameSamples], states: list[EpipolarState], refine_focal: bool
    ) -> None:
        self.frames, self.states, self.refine_focal = frames, states, refine_focal
        self.losses = [EpipolarLoss(True, REDESCENDING * max(robust_scale(s), MIN_SCALE_PX))
                       for s in states]  # fmt: skip
        self.cost = self._cost(states)

    def __call__(self, y: float) -> float:
        moved = [self._minimised(k, y) for k in range(len(self.frames))]
        cost = self._cost(moved)
        if cost < self.cost:
            self.cost, self.states = cost, moved
        return cost

    def _minimised(self, k: int, y: float) -> EpipolarState:
        state, data = self.states[k], self.frames[k].some
        projector = state.projector.with_(centre=(state.projector.centre[0], y))
        return minimise(
            evaluate(state.pose, projector, data), data, self.losses[k],
            refine_focal=self.refine_focal, iterations=_PATIENT,
        )  # fmt: skip

    def _cost(self, states: list[EpipolarState]) -> float:
        """Return the mean cost over the frames, each in squares of its own scale."""
        pairs = zip(self.losses, states, strict=True)
        return float(np.mean([loss.cost(s.r) / loss.scale**2 for loss, s in pairs]))


def _scale(states: Sequence[EpipolarState]) -> float:
    return max(robust_scale(s) for s in states)

"""Proposals of relative pose and focal length, to be refined: five-point RANSAC and homographies.

Neither knows the focal length, so both run for a ladder of focal lengths, on bearing vectors of
the projection model. They only propose: the focal length with the most inliers can be off by 80 %.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike

from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform, angle_between, rotation_angle

from .correspondences import Correspondences
from .epipolar_refinement import EpipolarLoss, evaluate
from .epipolar_residual import Bearings, bearings, residuals
from .triangulate import in_front
from .vectors import Vectors

LADDER = np.geomspace(1 / 3, 3, 12)
"""Focal lengths tried, over the projector's width."""
ABOVE_LIMIT = (1.0, 1.05, 1.12)
"""Focal lengths tried as well, over the smallest that the law allows: near it a projector that
reaches 90 degrees changes its bearings faster than the ladder has rungs."""
THRESHOLD_PX = 2.0
"""Pattern pixels from its epipolar curve within which RANSAC calls a correspondence an inlier.
Chosen: far above a decoder's noise, far below a grid period."""
RANSAC_ITERATIONS = 150
"""Samples of five: one is free of outliers with 99.9 % where 54 % of the data are, since
1 - (1 - 0.54^5)^150 = 0.999."""
SCORE_PX = 20.0
"""Cauchy scale of the proposals' order, pattern pixels: that at which their refinement begins."""
_IN_RANGE = 0.99  # share of coordinates that must be possible; outliers may lie beyond
_MIN_Z = 0.1  # of a unit direction: wider ones have no usable image on the plane z = 1
_LIMIT_FOUND = 1.005
"""Ratio of the ends at which the bisection for the shortest possible focal length stops."""
DISTINCT_ANGLE, DISTINCT_FOCAL = 0.1, 0.2
"""Radians and relative focal length within which proposals would descend to one minimum. Chosen."""
_NO_SHIFT = 1e-6
"""Length, distances of the plane, of a translation that says nothing of its direction."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A calibration worth refining."""

    pose: RigidTransform
    """projector_from_camera, |t| = 1."""
    focal: float
    score: float
    """Mean Cauchy loss at 20 px plus the share of points behind; lower is better."""


def propose(data: Correspondences, projector: ProjectorModel, focals: Vectors) -> list[Proposal]:
    """Return the proposals of every focal length, best first.

    OpenCV's random generator starts from a fixed seed in each call, so the result depends on the
    data alone.

    Args:
        data: a few hundred cleaned correspondences.
        focals: (F,) pattern pixels.
    """
    with ThreadPoolExecutor() as pool:
        of_focals = pool.map(lambda f: _at_focal(data, projector.with_(focal=float(f))), focals)
        return sorted((p for proposals in of_focals for p in proposals), key=lambda p: p.score)


def ladder(projector: ProjectorModel, width: int, data: Correspondences) -> Vectors:
    """Return the focal lengths to try, ascending, pattern pixels.

    A law with a limited range (``direction_cosine``) has a smallest focal length at which the seen
    coordinates still belong to a direction; rungs below it are useless and it gets its own.
    """
    rungs = LADDER * width

    def reached(focal: float) -> bool:
        pattern_bearings = bearings(projector.with_(focal=focal), data.q)
        return float(np.isfinite(pattern_bearings.b[2]).mean()) > _IN_RANGE

    if reached(rungs[0]):
        return rungs
    low, high = rungs[0], rungs[-1]
    while high > _LIMIT_FOUND * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return np.sort(np.concatenate([rungs[rungs > high], high * np.array(ABOVE_LIMIT)]))


def focal_lengths(
    projector: ProjectorModel,
    width: int,
    data: Correspondences,
    refine_focal: bool,
    guess: float | None,
) -> tuple[Vectors, tuple[float, float]]:
    """Return the focal lengths to propose and the bounds that the refinement must respect."""
    if not refine_focal:
        return np.array([projector.focal if guess is None else guess]), (0.0, np.inf)
    focals = ladder(projector, width, data)
    if guess is not None:
        focals = np.append(focals, guess)
    return focals, (focals.min() / 2, focals.max() * 2)


def distinct(proposals: list[Proposal], count: int) -> list[Proposal]:
    """Return up to ``count`` of the best that differ in pose or by 20 % in focal length."""
    kept: list[Proposal] = []
    for p in proposals:
        if len(kept) == count:
            break
        if not any(_alike(p, k) for k in kept):
            kept.append(p)
    return kept


def _alike(a: Proposal, b: Proposal) -> bool:
    same = same_pose(a.pose, b.pose, DISTINCT_ANGLE)
    return same and abs(np.log(a.focal / b.focal)) < DISTINCT_FOCAL


def same_pose(a: RigidTransform, b: RigidTransform, angle: float) -> bool:
    """Tell whether rotations and translation directions agree within ``angle``, radians."""
    return rotation_angle(a.R @ b.R.T) < angle and angle_between(a.t, b.t) < 2 * angle


def planar_poses(
    data: Correspondences, pattern_bearings: Bearings, threshold: float
) -> list[RigidTransform]:
    """Return the poses that explain the data as one plane, up to four, |t| = 1.

    On a plane the homography of bearings is R + t n^T / distance, which two poses in front of
    both devices share; the five-point method sees at most one of them.

    Args:
        threshold: inlier distance on the plane z = 1 of the projector.
    """
    pairs = _on_unit_plane(data, pattern_bearings)
    if pairs is None:
        return []
    H, _ = cv2.findHomography(*pairs, method=cv2.RANSAC, ransacReprojThreshold=threshold,
                              maxIters=100)  # fmt: skip
    if H is None or not np.isfinite(H).all():
        return []
    _, rotations, translations, _ = cv2.decomposeHomographyMat(H, np.eye(3))
    return [_unit(R, t) for R, t in zip(rotations, translations, strict=True)
            if np.linalg.norm(t) > _NO_SHIFT]  # fmt: skip


def facing(
    pose: RigidTransform, data: Correspondences, pattern_bearings: Bearings, noise_angle: float
) -> tuple[RigidTransform, float]:
    """Return the pose with the sign of t that puts most points in front, and the share that is."""
    sign = in_front(
        pose, pattern_bearings, residuals(pose, data.rays, pattern_bearings), noise_angle
    )
    reverse = RigidTransform(pose.R, -pose.t)
    sign_reverse = in_front(
        reverse, pattern_bearings, residuals(reverse, data.rays, pattern_bearings), noise_angle
    )
    if (sign_reverse < 0).sum() < (sign < 0).sum():
        pose, sign = reverse, sign_reverse
    return pose, 1 - float((sign < 0).mean())


def _at_focal(data: Correspondences, projector: ProjectorModel) -> list[Proposal]:
    pattern_bearings = bearings(projector, data.q)
    threshold = THRESHOLD_PX / projector.focal
    return [
        _scored(pose, data, projector, pattern_bearings)
        for pose in [
            *_five_point_poses(data, pattern_bearings, threshold),
            *planar_poses(data, pattern_bearings, 4 * threshold),
        ]
    ]


def _five_point_poses(
    data: Correspondences, pattern_bearings: Bearings, threshold: float
) -> Iterator[RigidTransform]:
    pairs = _on_unit_plane(data, pattern_bearings)
    if pairs is None:
        return
    E, _ = cv2.findEssentialMat(
        *pairs, np.eye(3), method=cv2.RANSAC, prob=0.999, threshold=threshold,
        maxIters=RANSAC_ITERATIONS,
    )  # fmt: skip
    if E is None or E.shape[1] != 3:
        return
    # Five-point solutions that fit equally well are stacked.
    for part in E.reshape(-1, 3, 3):
        first, second, t = cv2.decomposeEssentialMat(part)
        yield _unit(first, t)
        yield _unit(second, t)


def _on_unit_plane(
    data: Correspondences, pattern_bearings: Bearings
) -> tuple[Vectors, Vectors] | None:
    """Return ray and bearing pairs on the planes z = 1, or None where too few have z > 0."""
    with np.errstate(invalid="ignore"):
        z = pattern_bearings.b[2] / np.sqrt((pattern_bearings.b * pattern_bearings.b).sum(0))
        usable = (data.rays[2] > _MIN_Z) & (z > _MIN_Z)
    if usable.sum() < max(8, 0.5 * len(data)):
        return None
    rays, b = data.rays[:, usable], pattern_bearings.b[:, usable]
    return (
        np.ascontiguousarray((rays[:2] / rays[2]).T), np.ascontiguousarray((b[:2] / b[2]).T)
    )  # fmt: skip


def _scored(
    pose: RigidTransform,
    data: Correspondences,
    projector: ProjectorModel,
    pattern_bearings: Bearings,
) -> Proposal:
    pose, front = facing(pose, data, pattern_bearings, THRESHOLD_PX / projector.focal)
    fit = EpipolarLoss(redescending=False, scale=SCORE_PX).cost(
        evaluate(pose, projector, data, pattern_bearings).r
    )
    return Proposal(pose, projector.focal, fit + SCORE_PX**2 * (1 - front))


def _unit(R: ArrayLike, t: ArrayLike) -> RigidTransform:
    direction = np.asarray(t, np.float64)
    return RigidTransform.of(R, direction / np.linalg.norm(direction))

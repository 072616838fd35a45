"""Search for the motion and relative scale between two range images, without a guess."""

import numpy as np
from numpy.typing import NDArray

from .icp import Floats, Source, align, cost, match, sample
from .range_image import Level, RangePyramid
from .registration_quality import GATE_SCALE, JUDGED_POINTS, PairRegistration, judge
from .similarity import Similarities

STARTS = 512
"""Random motions tried."""
MAX_TURN = np.radians(18)
"""Largest rotation among the starts, radians: neighbouring frames are up to 15 degrees apart."""
MAX_SHIFT = 0.5
"""Largest translation among the starts, relative to the typical range."""
STAGES = ((0.05, 5, 200, 48), (0.03, 5, 400, 12), (0.02, 6, 1000, 6))
"""Scale of the loss relative to the typical range, steps, points, survivors."""
FINAL_SCALES = (0.015, 0.01)
"""Scales of the loss on the fine images, relative to the typical range. Chosen: those of the stages
go on."""
FINAL_STEPS = 6
"""Gauss-Newton steps at each of them. Chosen."""
SAME_TURN, SAME_SHIFT = 0.05, 0.05
"""Radians and typical ranges: candidates nearer to one another have reached, or will reach, one
minimum."""
WANDERED_TURN, WANDERED_SHIFT = np.radians(45), 1.0
"""Radians and typical ranges: candidates that drifted farther from no motion have left the range of
the search."""
MIN_CANDIDATE_OVERLAP = 0.1
"""Share of the points that must find a partner for a candidate to count at all."""


def register_pair(
    target: RangePyramid, source: RangePyramid, rng: np.random.Generator
) -> PairRegistration:
    """Find the placement of ``source`` in ``target`` among random starts.

    Starts race: after a few Gauss-Newton steps on few points the best distinct ones go on with
    more points and a narrower loss.
    """
    poses = _random_starts(rng)
    for scale, steps, count, keep in STAGES:
        cloud = sample(source.coarse, count, rng)
        poses = align(poses, cloud, target.coarse, scale, steps)
        poses, _ = _best(poses, _score(poses, cloud, target.coarse, scale), keep)
        if not len(poses):
            return PairRegistration()
    poses = _finish(poses, target, source, rng)
    poses, score = _best(poses, _mutual_score(poses, target, source, rng), len(poses))
    if not len(poses):
        return PairRegistration()
    runner_up = float(score[1] / score[0]) if len(poses) > 1 else np.inf
    return PairRegistration(poses[:1], judge(poses[:1], target, source, rng), runner_up)


def refine_pair(
    guess: Similarities, target: RangePyramid, source: RangePyramid, rng: np.random.Generator
) -> PairRegistration:
    """Improve a placement that is nearly right; there is no runner-up to compare with."""
    cloud = sample(source.fine, JUDGED_POINTS, rng)
    pose = align(guess, cloud, target.fine, GATE_SCALE, FINAL_STEPS)
    pose = _finish(pose, target, source, rng)
    return PairRegistration(pose, judge(pose, target, source, rng), np.inf)


def _finish(
    poses: Similarities, target: RangePyramid, source: RangePyramid, rng: np.random.Generator
) -> Similarities:
    cloud = sample(source.fine, JUDGED_POINTS, rng)
    for scale in FINAL_SCALES:
        poses = align(poses, cloud, target.fine, scale, FINAL_STEPS)
    return poses


def _random_starts(rng: np.random.Generator) -> Similarities:
    """Spread ``STARTS`` motions evenly over all rotations and translations worth trying.

    An additive sequence with a random offset (Roberts 2018): multiples of the powers of the
    generalised golden ratio, the root of x^7 = x + 1 in six dimensions, modulo one.
    """
    ratio = 1.1127756842787055 ** -np.arange(1.0, 7.0)
    cube = (rng.random(6) + np.arange(STARTS)[:, None] * ratio) % 1.0
    return Similarities.of(MAX_TURN * _in_ball(cube[:, :3]), MAX_SHIFT * _in_ball(cube[:, 3:]))


def _in_ball(cube: Floats) -> Floats:
    """Map the unit cube (N, 3) to the unit ball, keeping volumes."""
    radius, z, around = np.cbrt(cube[:, 0]), 2 * cube[:, 1] - 1, 2 * np.pi * cube[:, 2]
    flat = np.sqrt(1 - z * z)
    return radius[:, None] * np.stack([flat * np.cos(around), flat * np.sin(around), z], 1)


def _score(poses: Similarities, cloud: Source, target: Level, scale: float) -> Floats:
    """Return cost over overlap (B,): low residuals count for less when few points support them."""
    mean, overlap = cost(match(poses, cloud, target, scale), scale)
    return _per_overlap(mean, overlap, 1)


def _mutual_score(
    poses: Similarities, target: RangePyramid, source: RangePyramid, rng: np.random.Generator
) -> Floats:
    """Return the score (B,) over both directions: a match to a far, small place fails backwards.

    Overlap counts twice: a wall laid upon a corner of itself costs next to nothing, and beside a
    thing in front of it had a tenth of the right placement's cost and a fifth of its overlap.
    """
    scale = FINAL_SCALES[-1]
    there = cost(match(poses, sample(source.fine, JUDGED_POINTS, rng), target.fine, scale), scale)
    cloud = sample(target.fine, JUDGED_POINTS, rng)
    back = cost(match(poses.inverse(), cloud, source.fine, scale), scale)
    return _per_overlap((there[0] + back[0]) / 2, (there[1] + back[1]) / 2, 2)


def _per_overlap(mean: Floats, overlap: Floats, power: int) -> Floats:
    enough = overlap > MIN_CANDIDATE_OVERLAP
    return np.where(enough, mean / np.where(enough, overlap, 1.0) ** power, np.inf)


def _best(poses: Similarities, score: Floats, keep: int) -> tuple[Similarities, Floats]:
    """Return the ``keep`` best distinct candidates and their scores, lowest first."""
    turn = poses.angle_to(Similarities.identity())
    wandered = (turn > WANDERED_TURN) | (np.linalg.norm(poses.t, axis=1) > WANDERED_SHIFT)
    score = np.where(wandered, np.inf, score)
    kept: list[int] = []
    for i in np.argsort(score):
        if len(kept) == keep or not np.isfinite(score[i]):
            break
        if not kept or not _same(poses[np.full(len(kept), i)], poses[np.array(kept)]).any():
            kept.append(int(i))
    chosen = np.array(kept, np.intp)
    return poses[chosen], score[chosen]


def _same(a: Similarities, b: Similarities) -> NDArray[np.bool_]:
    return (a.angle_to(b) < SAME_TURN) & (np.linalg.norm(a.t - b.t, axis=1) < SAME_SHIFT)

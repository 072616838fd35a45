"""Point-to-plane alignment with scale of one range image to another, many starts at once.

Partners are found by projection: a moved source point is compared with the target point seen in
its direction (Blais and Levine 1995; point-to-plane after Chen and Medioni 1992). All lengths are
in the common unit of the frames, their typical range.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.robust import geman_mcclure_weight

from .range_image import Level
from .similarity import Similarities

Floats = NDArray[np.float64]

SCALE_SPREAD = 0.15
"""Standard deviation of the prior on the log of the frames' relative scale."""
MIN_NORMAL_COSINE = 0.5
"""Partners' normals differ by less than 60 degrees."""
MAX_STEP = 0.3
"""Bound on a step's components (radians, common unit, log): few partners can ask for anything."""
NEAR = 3.0
"""A partner is at most this many scales of the robust loss off the tangent plane."""
FAR = 0.5
"""Gap beyond which two points are no partners, in the unit of clouds about 1 away."""


@dataclass(frozen=True, eq=False)
class Source:
    """Points to be moved, a sample of a level."""

    points: Floats
    """(N, 3) in the source camera's frame."""
    normals: Floats
    """(N, 3)"""
    weights: Floats
    """(N,) 1 / relative noise."""


@dataclass(frozen=True, eq=False)
class Match:
    """B x N source points under B transforms, with their partners."""

    moved: Floats
    """(B, N, 3) source points in the target's frame."""
    normals: Floats
    """(B, N, 3) of the target."""
    source_normals: Floats
    """(B, N, 3) of the source, turned."""
    residual: Floats
    """(B, N) distance from the target's tangent plane divided by its relative noise."""
    weight: Floats
    """(B, N) 1 / relative noise; zero where the target sees nothing."""
    in_view: NDArray[np.bool_]
    """(B, N) the target sees something in that direction."""
    partner: NDArray[np.bool_]
    """(B, N) ... and it may be the same place."""


def sample(level: Level, count: int, rng: np.random.Generator) -> Source:
    """Draw ``count`` points of a level, spread evenly over it."""
    n = level.size
    if n > count:
        # One draw from each of `count` equal stretches of the scan order covers the image evenly.
        edges = np.linspace(0, n, count + 1)
        chosen = np.floor(edges[:-1] + rng.random(count) * np.diff(edges)).astype(np.intp)
    else:
        chosen = np.arange(n)
    return Source(level.points[chosen], level.normals[chosen], level.weights[chosen])


def match(target_from_source: Similarities, source: Source, target: Level, scale: float) -> Match:
    """Pair the source points with target points under each transform.

    Args:
        scale: scale of the robust loss; a point farther than ``NEAR`` of it is no partner.
    """
    moved = target_from_source.apply(source.points)
    turned = target_from_source.rotate(source.normals)
    at = target.look_up(moved)
    points, normals = target.points[at], target.normals[at]
    in_view = at < target.size
    weight = np.minimum(target.weights[at], source.weights)
    gap = moved - points
    residual = np.einsum("bnk,bnk->bn", normals, gap) * weight
    # A camera model without a branch mask also projects points from behind: demand nearness.
    near = np.einsum("bnk,bnk->bn", gap, gap) < FAR**2
    alike = np.einsum("bnk,bnk->bn", normals, turned) > MIN_NORMAL_COSINE
    partner = in_view & near & alike & (np.abs(residual) < NEAR * scale)
    return Match(moved, normals, turned, residual, weight, in_view, partner)


def cost(matches: Match, scale: float) -> tuple[Floats, Floats]:
    """Return the mean cost (B,) in 0..1 of points in common view and the overlap (B,).

    The cost is Geman-McClure's; a point without a partner where the target sees something costs 1.
    """
    squared = (matches.residual / scale) ** 2
    rho = np.where(matches.partner, squared / (1 + squared), 1.0) * matches.in_view
    in_view = matches.in_view.mean(1)
    overlap = matches.partner.mean(1)
    return rho.mean(1) / np.maximum(in_view, 1e-9), overlap


def align(
    target_from_source: Similarities, source: Source, target: Level, scale: float, steps: int
) -> Similarities:
    """Take Gauss-Newton steps under a Geman-McClure loss of the given scale from every start."""
    pose = target_from_source
    for _ in range(steps):
        matches = match(pose, source, target, scale)
        A, b, about = normal_equations(pose, matches, scale)
        step = np.linalg.solve(A, -b[..., None])[..., 0].astype(np.float64)
        pose = pose.moved(np.clip(step, -MAX_STEP, MAX_STEP), about)
    return pose


def normal_equations(
    pose: Similarities, matches: Match, scale: float
) -> tuple[Floats, Floats, Floats]:
    """Return A (B, 7, 7), b (B, 7) and the centres (B, 3) of a step (w, dt, d log s).

    Weights are relative to the number of points; the prior on scale and a slight damping are in.
    """
    J, about = jacobian(matches.moved, matches.normals)
    n = matches.residual.shape[1]
    robust = matches.partner * geman_mcclure_weight(matches.residual / scale) / n
    # Both the row and the residual carry the noise weight; the residual has it already.
    weighted = J * (robust * matches.weight)[..., None]
    A = np.swapaxes(weighted, 1, 2) @ (J * matches.weight[..., None])
    b = np.einsum("bnk,bn->bk", weighted, matches.residual)
    # The prior counts like one part in a hundred of the points at the loss's own scale.
    prior = 0.01 * (scale / SCALE_SPREAD) ** 2
    diagonal = np.arange(7)
    A[:, diagonal, diagonal] += 1e-5
    A[:, 6, 6] += prior
    b[:, 6] += prior * np.log(pose.s)
    return A, b, about


def jacobian(moved: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Return rows (B, N, 7) of n . dx for a step (w, dt, d log s) about the mean of ``moved``."""
    about = moved.mean(1)
    arm = moved - about[:, None]
    along = np.einsum("bnk,bnk->bn", normals, arm)
    return np.concatenate([np.cross(arm, normals), normals, along[..., None]], -1), about

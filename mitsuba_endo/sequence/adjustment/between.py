"""Frames that were not adjusted, placed again on the adjusted elements.

A frame's own equations against elements that are held give its poses. Its covariance is what its
own pixels leave open, and that of the adjusted unknowns, which the elements follow and the frame
with them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..linearise import Poses, orthonormal
from ..placement import Prior
from ..projector_prior import ProjectorDrift
from .adjust import Adjusted
from .cluster_covariance import curvature_weights
from .equations import FRAME, Weights
from .observations import AdjustedFrame, Seen, observe

Floats = NDArray[np.float64]

STEPS = 3
"""Gauss-Newton steps: where a neighbour's correction leads to is a deviation or two off."""


@dataclass(frozen=True, eq=False)
class Between:
    """A frame placed on adjusted elements."""

    number: int
    poses: Poses
    covariance: Floats
    """(12, 12) of the step, see :meth:`Poses.moved`."""
    noise: float
    """Of a coordinate, pattern pixels."""


@dataclass(frozen=True, eq=False)
class _Placed:
    number: int
    poses: Poses
    noise: float
    own: Floats
    """(12, 12) covariance, the elements given, if errors of pixels were as alike as design says."""
    ratio: Floats
    """(12,) of the variances that blocks of the image show to those."""
    shared: Floats
    """(12, 12) covariance that the adjusted unknowns pass on."""


def place_between(
    adjusted: Adjusted,
    tracked: Sequence[AdjustedFrame],
    others: Iterable[AdjustedFrame],
    drift: ProjectorDrift,
) -> list[Between]:
    """Place frames on what others were adjusted to.

    Args:
        adjusted: with its elements.
        tracked: the same frames before the adjustment.
        others: the frames to place, as they were tracked.
        drift: of the projector from its place in the nearest adjusted frame.
    """
    numbers = np.array([frame.number for frame in adjusted.frames])
    placed = []
    for frame in others:
        near = int(np.abs(numbers - frame.number).argmin())
        start = _corrected(frame.poses, tracked[near].poses, adjusted.frames[near].poses)
        placed.append(_place(replace(frame, poses=start), adjusted, near, drift))
    if not placed:
        return []
    factor = np.sqrt(np.mean([p.ratio for p in placed], axis=0))
    return [
        Between(p.number, p.poses, factor[:, None] * p.own * factor + p.shared, p.noise)
        for p in placed
    ]


def _corrected(tracked: Poses, was: Poses, now: Poses) -> Poses:
    """Return poses moved as those of a neighbour were by the adjustment."""
    camera = now.world_from_camera @ was.world_from_camera.inverse()
    projector = now.projector_from_camera @ was.projector_from_camera.inverse()
    return Poses(
        orthonormal(camera @ tracked.world_from_camera),
        orthonormal(projector @ tracked.projector_from_camera),
    )


def _place(frame: AdjustedFrame, adjusted: Adjusted, near: int, drift: ProjectorDrift) -> _Placed:
    neighbour = adjusted.frames[near]
    mean = neighbour.poses.projector_from_camera
    prior = drift.prior(mean, np.zeros((6, 6)), abs(frame.number - neighbour.number))
    for _ in range(STEPS):
        observations = observe(frame, adjusted.elements, adjusted.projector, 1.0)
        A, b = _equations(
            observations, Weights(observations.on_line, observations.weight), prior, frame, adjusted
        )
        step = np.linalg.solve(A, b).astype(np.float64)
        frame = replace(frame, poses=frame.poses.moved(step), noise=observations.noise)
    observations = observe(frame, adjusted.elements, adjusted.projector, 1.0)
    weights = curvature_weights(observations)
    A, _ = _equations(observations, weights, prior, frame, adjusted)
    own = np.linalg.inv(A).astype(np.float64)
    V = _scatter(observations) / adjusted.design**2
    V[:6, :6] += prior.information
    follows = _follows(observations, weights, adjusted)
    follows[:6, FRAME * near : FRAME * near + 6] += prior.information
    shared = own @ follows @ adjusted.covariance.matrix @ follows.T @ own
    ratio = np.diag(own @ V @ own) / np.diag(own)
    return _Placed(frame.number, frame.poses, frame.noise, own, ratio, shared)


def _equations(
    observations: Seen, weights: Weights, prior: Prior, frame: AdjustedFrame, adjusted: Adjusted
) -> tuple[Floats, Floats]:
    """Return A (12, 12) and b (12,) of a step, pixels counting for as much as they tell."""
    rows, across = observations.by_unknowns[:FRAME], observations.across_by_unknowns[:FRAME]
    A = ((rows * weights.along) @ rows.T + (across * weights.across) @ across.T) / adjusted.design
    b = rows @ (weights.along * observations.along) + across @ (
        weights.across * observations.across
    )
    b /= adjusted.design
    A[:6, :6] += prior.information
    b[:6] -= prior.information @ prior.pull(frame.poses)
    return A + 1e-12 * np.trace(A) * np.eye(FRAME), b


def _scatter(observations: Seen) -> Floats:
    """Return (12, 12) sum over blocks of the image of their gradients' squares."""
    rows = observations.by_unknowns[:FRAME] * (observations.weight * observations.along)
    rows += observations.across_by_unknowns[:FRAME] * (observations.on_line * observations.across)
    sums = np.stack([np.bincount(observations.block, row) for row in rows]).astype(np.float64)
    return sums @ sums.T


def _follows(observations: Seen, weights: Weights, adjusted: Adjusted) -> Floats:
    """Return (12, n) how the gradient goes with the adjusted unknowns, through the elements."""
    by = (
        observations.by_unknowns[:FRAME]
        * (weights.along * observations.by_element)
        / adjusted.design
    )
    out = np.zeros((FRAME, len(adjusted.covariance.matrix)))
    for part in adjusted.equations.responses:
        here = part.among(observations.element)
        g = part.g[:, observations.element[here] - part.first]
        out[:, part.columns] += by[:, here] @ g.T
    return out

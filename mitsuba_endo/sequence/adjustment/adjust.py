"""All frames' poses and the focal length together, on a surface of free elements.

A bundle adjustment for a camera and a projector: it minimises the same residuals as ``calibrate``,
rendered minus observed coordinates, without any smoothness, and closes loops by itself, since an
element belongs to all frames that see it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ..linearise import Poses
from .cluster_covariance import Covariance, covariance, curvature_weights, scatter
from .drift_and_gauge import Plan, drift_equations, gauge
from .equations import FRAME, Equations, Weights, equations
from .observations import AdjustedFrame, Elements, Seen, observe

Floats = NDArray[np.float64]

WIDENINGS = (4.0, 2.0, 1.0, 1.0, 1.0)
"""One a Gauss-Newton step: how many times wider the loss is than noise needs. Where a loop is open,
frames disagree by more than noise. Chosen: the errors of later steps are a tenth of a deviation."""


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What an adjustment found."""

    frames: list[AdjustedFrame]
    projector: ProjectorModel
    elements: Elements
    covariance: Covariance
    equations: Equations
    """At the solution, under the curvature's weights."""
    design: float
    """Variance of the gradient over that of white noise: how alike the errors of neighbours are."""


def adjust(
    frames: Sequence[AdjustedFrame], elements: Elements, projector: ProjectorModel, plan: Plan
) -> Adjusted:
    """Adjust frames that were tracked.

    Args:
        frames: two or more, in order; the first camera is the world, its baseline the unit.
        elements: of the surface they saw, roughly.
        projector: with nearly the right focal length.
        plan: what is free.
    """
    frames, design = list(frames), 1.0
    for widened in WIDENINGS:
        all_observations = [observe(frame, elements, projector, widened) for frame in frames]
        weights = [Weights(s.on_line, s.weight) for s in all_observations]
        at = equations(all_observations, weights, len(elements.points))
        design = _design(all_observations, weights)
        step = _step(at, frames, plan, design)
        elements = elements.moved(at.element_steps(step))
        projector = projector.with_(focal=float(projector.focal) * float(np.exp(step[-1])))
        frames = _moved(frames, step, all_observations)
    return _finished(frames, elements, projector, plan, design)


def _step(at: Equations, frames: list[AdjustedFrame], plan: Plan, design: float) -> Floats:
    """Return a Gauss-Newton step.

    The drift is no information of pixels: it weighs as much more as these tell less than white
    noise would let them.
    """
    A_drift, b_drift = drift_equations(frames, plan.drift)
    held, free = gauge(at.A, frames[0].poses.projector_from_camera, plan)
    A, b = at.A + design * A_drift + held, at.b + design * b_drift
    where = np.ix_(free, free)
    step = np.zeros(len(b))
    step[free] = scipy.linalg.cho_solve(scipy.linalg.cho_factor(A[where]), b[free])
    return step


def _moved(
    frames: list[AdjustedFrame], step: Floats, all_observations: list[Seen]
) -> list[AdjustedFrame]:
    baseline = float(np.linalg.norm(frames[0].poses.projector_from_camera.t))
    out = [
        replace(f, poses=f.poses.moved(step[FRAME * k : FRAME * (k + 1)]), noise=s.noise)
        for k, (f, s) in enumerate(zip(frames, all_observations, strict=True))
    ]
    pose = out[0].poses.projector_from_camera  # a step keeps the baseline's length to first order
    pose = RigidTransform(pose.R, pose.t * baseline / np.linalg.norm(pose.t))
    out[0] = replace(out[0], poses=Poses(out[0].poses.world_from_camera, pose))
    return out


def _finished(
    frames: list[AdjustedFrame], elements: Elements, projector: ProjectorModel, plan: Plan,
    design: float,
) -> Adjusted:  # fmt: skip
    all_observations = [observe(frame, elements, projector, 1.0) for frame in frames]
    weights = [curvature_weights(s) for s in all_observations]
    at = equations(all_observations, weights, len(elements.points))
    A_drift, _ = drift_equations(frames, plan.drift)
    held, free = gauge(at.A, frames[0].poses.projector_from_camera, plan)
    V = scatter(all_observations, at, weights) + design**2 * A_drift
    uncertainty = covariance(at.A + design * A_drift + held, V, free)
    return Adjusted(frames, projector, elements, uncertainty, at, design)


def _design(all_observations: Sequence[Seen], weights: Sequence[Weights]) -> float:
    """Return the mean ratio of variances of the projectors' gradients: by blocks over white."""
    by_block, white = np.zeros(6), np.zeros(6)
    for s, w in zip(all_observations, weights, strict=True):
        rows, score = s.across_by_unknowns[:6], w.across * s.across
        sums = np.stack([np.bincount(s.block, row) for row in rows * score])
        by_block += (sums**2).sum(1)
        white += (rows**2 * score**2).sum(1)
    return max(float(np.mean(by_block / white)), 1.0)

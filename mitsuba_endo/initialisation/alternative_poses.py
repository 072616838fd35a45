"""Other calibrations that explain the correspondences about as well as a given one.

Two poses explain a plane exactly: its homography R + t n^T / distance splits in two ways (Faugeras
and Lustman 1988). Depth rejects one of them unless both put the plane in front of both devices.
"""

from dataclasses import dataclass

import numpy as np

from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform

from .choose import (
    REDESCENDING,
    SIMILAR_COST,
    Minimum,
    RefinementProblem,
    cost_margin,
    refine,
    robust_scale,
)
from .correspondences import Correspondences, spread_sample
from .epipolar_refinement import EpipolarLoss, evaluate, minimise
from .notes import is_planar
from .relative_pose_ransac import distinct, propose

SAMPLE = 4000
"""Correspondences that are looked at; twins differ in all of them."""
_PROPOSALS = 4
"""Poses that compete beside the given one. Chosen."""
_FOCAL_FACTOR = 6.0
"""By which an alternative's focal length may differ. Chosen: the ladder of proposals spans
a factor of 9."""


@dataclass(frozen=True, eq=False)
class AlternativePose:
    """Another minimum of the epipolar cost."""

    projector_from_camera: RigidTransform
    """|t| = 1."""
    focal: float
    """Pattern pixels."""
    cost_ratio: float
    """Robust epipolar cost over that of the given calibration, both at their minima."""
    decided: bool
    """Whether the residuals prefer the given calibration by more than noise can make."""
    better: bool
    """Whether they prefer this one by more than noise can make: the given one was no minimum of
    the whole."""
    planar: bool
    """Whether the surface is nearly one plane under the given calibration."""


def alternative_poses(
    data: Correspondences,
    projector: ProjectorModel,
    pose: RigidTransform,
    *,
    refine_focal: bool,
    noise_px: float,
    width: int,
    seed: int = 0,
) -> list[AlternativePose]:
    """Return the alternatives of a calibration, best first; most scenes have none.

    Args:
        data: correspondences that were used.
        projector: of the calibration.
        pose: projector_from_camera, any unit of length.
        refine_focal: whether an alternative may have another focal length.
        noise_px: standard deviation of one component of q, pattern pixels.
        width: of the map, pixels.
        seed: of the sample drawn.
    """
    rng = np.random.default_rng(seed)
    some = spread_sample(data, SAMPLE, width, rng)
    few = spread_sample(some, SAMPLE // 8, width, rng)
    focal = float(projector.focal)
    bounds = (focal / _FOCAL_FACTOR, focal * _FOCAL_FACTOR)
    problem = RefinementProblem(projector, refine_focal, bounds, noise_px)
    unit = RigidTransform(pose.R, pose.t / np.linalg.norm(pose.t))
    proposals = distinct(propose(few, projector, np.array([focal])), _PROPOSALS)
    starts = [(unit, focal), *((p.pose, p.focal) for p in proposals)]
    return _rated(problem, unit, refine(problem, starts, some), some)


def _rated(
    problem: RefinementProblem,
    pose: RigidTransform,
    minima: list[Minimum],
    data: Correspondences,
) -> list[AlternativePose]:
    """Compare the minima with the given calibration under one loss; drop itself and worse ones."""
    given = evaluate(pose, problem.projector, data)
    scale = robust_scale(given)
    loss = EpipolarLoss(True, REDESCENDING * scale)
    given = minimise(
        given, data, loss, refine_focal=problem.refine_focal, focal_bounds=problem.focal_bounds
    )
    lowest = loss.cost(given.r)
    planar = is_planar(given, data)
    itself = Minimum(given, 1.0)
    out = []
    for m in minima:
        cost = loss.cost(m.state.r)
        margin = cost_margin(given.r, m.state.r, loss)
        decided, better = cost - lowest > margin, lowest - cost > margin
        if m.same_as(itself) or (decided and cost > SIMILAR_COST * lowest):
            continue
        candidate = m.candidate
        ratio = cost / lowest
        out.append(
            AlternativePose(
                candidate.projector_from_camera, candidate.focal, ratio, decided, better, planar
            )
        )
    return sorted(out, key=lambda r: r.cost_ratio)

"""Calibrations that the data cannot, or can hardly, tell from the one found."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform, angle_between, rotation_angle
from ...records.solution import Alternative
from ...start.correspondences import Correspondences
from ...start.rivals import Rival, rivals
from ..fit import Fit
from ..optimise.rendered import USED_WEIGHT
from ..unknowns.plan import Plan
from ..unknowns.state import intrinsics_model

AMBIGUOUS = "another pose explains the correspondences as well, see alternatives"
"""Why a pose with an undecided rival is weak."""
_REGION = 5.0
"""A rival within this many standard deviations of the solution's pose is the same calibration."""


def ambiguities(
    fit: Fit, covariance: NDArray[np.float64], known: Sequence[bool]
) -> list[tuple[list[int], Rival]]:
    """Return the rivals of every projector pose with the frames that share it.

    Frames that share one surface and have projector poses of their own are passed over: a pose
    of one that bends its plane away from the others' surface does not survive the joint solution.

    Args:
        fit: what was found.
        covariance: (G, G) of its global unknowns.
        known: for every frame, whether the data determine its projector pose; a family of poses
            that fit is no rival but an unknown that is unobservable.
    """
    plan = fit.problem.plan
    out = []
    for frames in _groups(plan):
        if known[frames[0]]:
            out += [(frames, rival) for rival in _rivals(fit, covariance, frames)]
    return out


def alternative(rival: Rival, names: list[str], found: RigidTransform, focal: float) -> Alternative:
    """Describe a rival for the solution.

    Args:
        rival: another calibration.
        names: of the frames that it concerns.
        found: the solution's pose in its own unit.
        focal: the solution's, pattern pixels.
    """
    pose = rival.projector_from_camera
    turned, moved = np.degrees(_distances(pose, found))
    kind = (
        "the other pose of a plane: the surface seen is nearly planar"
        if rival.planar
        else "another minimum of the cost"
    )
    how = (
        f"it fits {100 * (rival.cost_ratio - 1):.2g} % worse, more than noise makes"
        if rival.decided
        else "it fits as well within the noise, so the residuals cannot choose"
    )
    other = f", focal length {rival.focal:.6g} px" if abs(rival.focal / focal - 1) > 1e-4 else ""
    return Alternative(
        frames=names,
        R=pose.R.tolist(),
        t=(np.linalg.norm(found.t) * pose.t).tolist(),
        focal=rival.focal,
        cost_ratio=rival.cost_ratio,
        decided=rival.decided,
        reason=(
            f"{kind}; rotation {turned:.3g} and translation direction {moved:.3g} degrees away"
            f"{other}; {how}; a frame that sees relief, or a rough pose in the rig file, tells "
            "them apart"
        ),
    )


def _groups(plan: Plan) -> list[list[int]]:
    every = list(range(plan.frames))
    if plan.blocks["projector_pose"] == "fixed":
        return []
    if plan.blocks["projector_pose"] == "shared":
        return [every]
    return [[k] for k in every] if plan.surfaces == plan.frames else []


def _rivals(fit: Fit, covariance: NDArray[np.float64], frames: list[int]) -> list[Rival]:
    plan, state, first = fit.problem.plan, fit.state, frames[0]
    pose = state.projector_from_camera[first]
    found = rivals(
        _correspondences(fit, frames),
        intrinsics_model(fit.law, state.intrinsics[first]),
        pose,
        refine_focal=plan.blocks["focal"] != "fixed",
        noise_px=fit.uncertainty.sigma,
        width=fit.problem.frames[first].shape[1],
    )
    slot = plan.slot("projector_pose", first)
    assert slot is not None  # groups hold poses that are unknowns
    std = np.sqrt(np.diag(covariance)[slot])
    region = _REGION * np.array([np.linalg.norm(std[:3]), np.linalg.norm(std[3:])])
    return [r for r in found if (_distances(r.projector_from_camera, pose) > region).any()]


def _distances(a: RigidTransform, b: RigidTransform) -> NDArray[np.float64]:
    """Return the angles between rotations and between translation directions, radians."""
    return np.array([rotation_angle(a.R @ b.R.T), angle_between(a.t, b.t)])


def _correspondences(fit: Fit, frames: list[int]) -> Correspondences:
    """Return the correspondences that the robust loss kept; frames are told apart by rows."""
    pixel, rays, q = [], [], []
    for place, k in enumerate(frames):
        frame = fit.problem.frames[k]
        used = fit.reported.weights[k] > USED_WEIGHT
        x, y = frame.pixels[used].T
        height, width = frame.shape
        pixel.append((place * height + y) * width + x)
        rays.append(frame.rays[used].T)
        q.append(frame.q[:, used])
    return Correspondences(
        np.concatenate(pixel),
        np.ascontiguousarray(np.concatenate(rays, 1)),
        np.ascontiguousarray(np.concatenate(q, 1)),
    )

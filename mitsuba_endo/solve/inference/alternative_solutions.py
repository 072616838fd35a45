"""Calibrations that the data cannot, or can hardly, tell from the one found."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform, angle_between, rotation_angle
from ...initialisation.alternative_poses import AlternativePose, alternative_poses
from ...initialisation.correspondences import Correspondences
from ...records.solution import Alternative
from ..minimisers.result import USED_WEIGHT, OptimisationResult
from ..unknowns.layout import Layout

AMBIGUOUS = "another pose explains the correspondences as well, see alternatives"
"""Why a pose with an undecided alternative is weak."""
_REGION = 5.0
"""A pose within this many standard deviations of the solution's is the same calibration."""
_OTHER_FOCAL = 1e-4
"""Relative difference from which on an alternative's focal length is told: six digits are shown."""


def ambiguities(
    result: OptimisationResult,
    noise_px: float,
    covariance: NDArray[np.float64],
    determined: Sequence[bool],
) -> list[tuple[list[int], AlternativePose]]:
    """Return the alternatives of every projector pose with the frames that share it.

    Frames that share one surface and have projector poses of their own are passed over: a pose
    of one that bends its plane away from the others' surface does not survive the joint solution.

    Args:
        result: what was found.
        noise_px: of one coordinate, pattern pixels.
        covariance: (G, G) of its global unknowns.
        determined: for every frame, whether the data determine its projector pose; a family of
            poses that fit is no alternative but an unknown that is unobservable.
    """
    out = []
    for frames in _groups(result.problem.layout):
        if determined[frames[0]]:
            out += [
                (frames, alternative)
                for alternative in _distinct(result, noise_px, covariance, frames)
            ]
    return out


def superior(result: OptimisationResult) -> list[tuple[list[int], AlternativePose]]:
    """Return those that fit better than a result by more than noise makes, with their frames.

    They are sought only where residuals are larger than the noise of the maps explains.
    """
    out = []
    for frames in _groups(result.problem.layout):
        alternatives = _alternative_poses(result, result.noise.sigma, frames)
        out += [(frames, alternative) for alternative in alternatives if alternative.better]
    return out


def describe_alternative(
    alternative: AlternativePose, names: list[str], solution_pose: RigidTransform, focal: float
) -> Alternative:
    """Describe an alternative for the solution.

    Args:
        alternative: another calibration.
        names: of the frames that it concerns.
        solution_pose: the solution's pose in its own unit.
        focal: the solution's, pattern pixels.
    """
    pose = alternative.projector_from_camera
    turned, moved = np.degrees(_distances(pose, solution_pose))
    kind = (
        "the other pose of a plane: the surface seen is nearly planar"
        if alternative.planar
        else "another minimum of the cost"
    )
    how = (
        "it fits better in a sample of the correspondences, but not with the surface"
        if alternative.better
        else f"it fits {100 * (alternative.cost_ratio - 1):.2g} % worse, more than noise makes"
        if alternative.decided
        else "it fits as well within the noise, so the residuals cannot choose"
    )
    other = (
        f", focal length {alternative.focal:.6g} px"
        if abs(alternative.focal / focal - 1) > _OTHER_FOCAL
        else ""
    )
    return Alternative(
        frames=names,
        R=pose.R.tolist(),
        t=(np.linalg.norm(solution_pose.t) * pose.t).tolist(),
        focal=alternative.focal,
        cost_ratio=alternative.cost_ratio,
        decided=alternative.decided,
        reason=(
            f"{kind}; rotation {turned:.3g} and translation direction {moved:.3g} degrees away"
            f"{other}; {how}; a frame that sees relief, or a rough pose in the rig file, tells "
            "them apart"
        ),
    )


def _groups(layout: Layout) -> list[list[int]]:
    every = list(range(layout.frames))
    mode = layout.sharing("projector_pose")
    if mode == "shared":
        return [every]
    own = mode == "per_frame" and layout.surfaces == layout.frames
    return [[k] for k in every] if own else []


def _alternative_poses(
    result: OptimisationResult, noise_px: float, frames: list[int]
) -> list[AlternativePose]:
    problem, state, first = result.problem, result.state, frames[0]
    projector = problem.projector(state, first)
    if projector is None:  # the epipolar search knows plain models only
        return []
    return alternative_poses(
        _correspondences(result, frames),
        projector,
        state.at("projector_pose", first),
        refine_focal=problem.layout.free["focal"],
        noise_px=noise_px,
        width=problem.observed[first].shape[1],
    )


def _distinct(
    result: OptimisationResult,
    noise_px: float,
    covariance: NDArray[np.float64],
    frames: list[int],
) -> list[AlternativePose]:
    """Return the alternatives that lie outside what the covariance allows the solution."""
    pose = result.state.at("projector_pose", frames[0])
    slot = result.problem.layout.slot("projector_pose", frames[0])
    assert slot is not None  # groups hold poses that are unknowns
    std = np.sqrt(np.diag(covariance)[slot])
    region = _REGION * np.array([np.linalg.norm(std[:3]), np.linalg.norm(std[3:])])
    alternatives = _alternative_poses(result, noise_px, frames)
    return [r for r in alternatives if (_distances(r.projector_from_camera, pose) > region).any()]


def _distances(a: RigidTransform, b: RigidTransform) -> NDArray[np.float64]:
    """Return the angles between rotations and between translation directions, radians."""
    return np.array([rotation_angle(a.R @ b.R.T), angle_between(a.t, b.t)])


def _correspondences(result: OptimisationResult, frames: list[int]) -> Correspondences:
    """Return the correspondences that the robust loss kept; frames are told apart by rows."""
    pixel, rays, q = [], [], []
    for index, k in enumerate(frames):
        frame = result.problem.observed[k]
        used = result.weights[k] > USED_WEIGHT
        x, y = frame.pixels[used].T
        height, width = frame.shape
        pixel.append((index * height + y) * width + x)
        rays.append(result.problem.rays(result.state, k)[used].T)
        q.append(frame.q[:, used])
    return Correspondences(
        np.concatenate(pixel),
        np.ascontiguousarray(np.concatenate(rays, 1)),
        np.ascontiguousarray(np.concatenate(q, 1)),
    )

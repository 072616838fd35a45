"""The finish of a part: its frames adjusted, its map fused anew, what each pose is worth."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...fusion import FusedMesh, Volume, surface_of
from ...geometry.projection_models import ProjectorModel
from ..kept_views import KeptView, KeptViews
from ..linearise import Poses
from ..map_drift import in_world
from ..range_images import ranged
from .adjust import Adjusted, adjust
from .between import place_between
from .drift_and_gauge import Plan
from .observations import AdjustedFrame, Elements

Floats = NDArray[np.float64]

ELEMENTS = 12_000
"""Of the surface, at most. Chosen: errors of neighbours are alike, and twice as many bring no
pose nearer to the truth."""
FEW = 24
"""Frames of a part of which all are adjusted, not the fused ones alone: about as many as a joint
calibration holds. With errors as of the decoder that takes a tenth off those of 16 frames; of 80
photographs, whose errors are alike from frame to frame, it only made intervals narrower."""
CELL = 12
"""Voxels: elements of one cube of this side are neighbours in memory, so that few frames see a
chunk of them."""


@dataclass(frozen=True, eq=False)
class FinishedPose:
    """Of one frame."""

    poses: Poses
    covariance: Floats
    """(12, 12) of :meth:`RigidTransform.perturbed`'s steps of projector_from_camera and of
    world_from_camera; zero where the gauge holds."""
    noise: float


@dataclass(frozen=True, eq=False)
class FinishedPart:
    """A part after its adjustment."""

    volume: Volume
    adjusted: Adjusted
    poses: dict[int, FinishedPose]
    """By the frames' numbers."""


def finish_part(
    kept: KeptViews, volume: Volume, projector: ProjectorModel, plan: Plan, seed: int
) -> FinishedPart | None:
    """Adjust the fused frames of a part, or all of a short one, place the others, and fuse anew.

    Args:
        kept: the frames, as tracked.
        volume: the map, as tracked.
        projector: with the focal length that was held.
        plan: what is free.
        seed: of the choice of surface elements.

    Returns:
        None where nothing can be adjusted: fewer than two fused frames, no surface, or frames that
        leave their poses open.
    """
    elements = _elements(volume, seed)
    if len(kept.fused) < 2 or elements is None:
        return None
    views, others = _divided(kept)
    frames = [_frame(view) for view in sorted(views, key=lambda view: view.number)]
    try:
        adjusted = adjust(frames, elements, projector, plan)
    except np.linalg.LinAlgError:
        return None
    placed = place_between(adjusted, frames, (_frame(view) for view in others), plan.drift)
    poses = {
        f.number: _finished(f.poses, adjusted.covariance.of_frame(k), f.noise)
        for k, f in enumerate(adjusted.frames)
    }
    poses.update({b.number: _finished(b.poses, b.covariance, b.noise) for b in placed})
    fused = {view.number for view in kept.fused}
    return FinishedPart(_fused(adjusted, fused, volume.voxel), adjusted, poses)


def _divided(kept: KeptViews) -> tuple[list[KeptView], list[KeptView]]:
    """Return the frames to adjust, all where they are few enough, and those to place."""
    every = [*kept.fused, *kept.between]
    return (every, []) if len(every) <= FEW else (kept.fused, kept.between)


def with_deviations(mesh: FusedMesh, adjusted: Adjusted) -> FusedMesh:
    """Return a mesh whose deviations count the poses of the frames that saw each vertex.

    The fusion's own deviation, from how frames disagree, knows nothing of an error that moves what
    all of them see. How elements follow the adjusted unknowns does; a vertex takes that of the
    nearest one.
    """
    from scipy.spatial import KDTree

    shared = np.zeros(len(adjusted.elements.points))
    covariance = adjusted.covariance.matrix
    for part in adjusted.equations.responses:
        g = part.g.astype(np.float64)
        inside = covariance[np.ix_(part.columns, part.columns)]
        shared[part.first : part.first + g.shape[1]] = np.einsum("cm,cm->m", g, inside @ g)
    informed = np.flatnonzero(adjusted.equations.information > 0)
    near = informed[KDTree(adjusted.elements.points[informed]).query(mesh.vertices)[1]]
    return replace(mesh, std=np.hypot(mesh.std, np.sqrt(np.maximum(shared[near], 0.0))))


def _elements(volume: Volume, seed: int) -> Elements | None:
    try:
        mesh = surface_of(volume)
    except ValueError:  # no two pixels beside each other
        return None
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(mesh.vertices))[:ELEMENTS]
    cell = np.floor(mesh.vertices[chosen] / (CELL * volume.voxel)).astype(np.int64)
    chosen = chosen[np.lexsort(cell.T)]
    return Elements(mesh.vertices[chosen], mesh.normals[chosen])


def _frame(kept: KeptView) -> AdjustedFrame:
    return AdjustedFrame(kept.number, kept.view, kept.poses, kept.noise)


def _finished(poses: Poses, covariance: Floats, noise: float) -> FinishedPose:
    return FinishedPose(poses, in_world(covariance, poses.world_from_camera), noise)


def _fused(adjusted: Adjusted, fused: set[int], voxel: float) -> Volume:
    volume = Volume(voxel)
    for frame in (f for f in adjusted.frames if f.number in fused):
        volume.integrate(ranged(frame.view, frame.poses, adjusted.projector, frame.noise).frame)
    return volume

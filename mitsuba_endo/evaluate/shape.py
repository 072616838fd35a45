"""Errors of the surface."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import ProjectorEstimate
from .alignment import Similarity, align_robustly
from .depth import Floats, RayCaster, range_image
from .distance import distance_to_mesh
from .metric_value import root_mean_square

Alignment = Literal["none", "scale", "rigid", "similarity"]

_SHADOW_TOLERANCE = 1e-3  # share of the range: far above rounding, far below any relief


@dataclass(frozen=True, eq=False)
class Lighting:
    """What decides whether the projector lights a point that the camera sees."""

    projector: ProjectorModel
    size: tuple[int, int]
    """Width and height of the pattern, pattern pixels."""
    projector_from_camera: RigidTransform


def model_and_size(projector: ProjectorEstimate) -> tuple[ProjectorModel, tuple[int, int]] | None:
    """Return a projector, and width and height of its pattern; None where one is not known."""
    model, size = projector.to_model(), (projector.width, projector.height)
    return None if model is None or not (size[0] and size[1]) else (model, (size[0], size[1]))


@dataclass(frozen=True)
class ShapeErrors:
    """How far the solution's surface is from the true one, after the alignment."""

    rmse: float
    """Root mean square distance of the solution's vertices to the true surface."""
    median: float
    """Median of the same distances."""
    ray_rmse: float | None
    """Root mean square difference of range along the camera's rays that meet both surfaces."""
    coverage: float | None
    """Share of the true surface, counted in camera pixels, that the solution covers."""
    alignment_scale: float
    """What the solution was multiplied by."""


def compare_shape(
    solution: SurfaceEstimate,
    truth: SurfaceEstimate,
    camera: CameraModel,
    lighting: Lighting | None = None,
    alignment: Alignment = "none",
) -> ShapeErrors | str:
    """Compare two surfaces in the frame of ``camera``.

    Every point of the solution is compared with the nearest point of the truth (which forgives
    sliding along the surface) and, separately, along the camera's rays (which does not). Coverage
    counts the pixels whose true point the pattern reaches unoccluded (all that see the truth where
    ``lighting`` is None) and where the solution has a surface too, at whatever distance.

    Args:
        solution: surface in the camera's frame, any unit if the alignment has a scale.
        truth: surface in the same frame, mm.
        camera: the first frame's camera.
        lighting: the true projector in the same frame.
        alignment: what is taken out first, from the pairs of points on the same camera rays:
            nothing; a scale about the camera centre; a rigid motion; both.

    Returns:
        The errors, mm, or a sentence saying why there are none.
    """
    similarity = alignment_of(solution, truth, camera, alignment)
    if isinstance(similarity, str):
        return similarity
    truth_caster = RayCaster(truth.vertices, truth.faces)
    true_range = range_image(truth_caster, camera)
    vertices = similarity.apply(solution.vertices)
    distance = distance_to_mesh(vertices[np.unique(solution.faces)], truth.vertices, truth.faces)
    ranges = range_image(RayCaster(vertices, solution.faces), camera)
    difference = (ranges - true_range)[np.isfinite(ranges) & np.isfinite(true_range)]
    wanted = _reached(truth_caster, true_range, camera, lighting)
    return ShapeErrors(
        rmse=root_mean_square(distance),
        median=float(np.median(distance)),
        ray_rmse=root_mean_square(difference) if len(difference) else None,
        coverage=float(np.isfinite(ranges[wanted]).mean()) if wanted.any() else None,
        alignment_scale=similarity.scale,
    )


def alignment_of(
    solution: SurfaceEstimate, truth: SurfaceEstimate, camera: CameraModel, alignment: Alignment
) -> Similarity | str:
    """Return what an alignment does to the solution, or a sentence saying why it cannot be had.

    Both surfaces are in the frame of ``camera``; see :func:`compare_shape`.
    """
    if alignment == "none":
        return Similarity.identity()
    ranges, true = (range_image(RayCaster(s.vertices, s.faces), camera) for s in (solution, truth))
    both = np.isfinite(ranges) & np.isfinite(true)
    if np.count_nonzero(both) < 3:
        return "no camera ray meets both surfaces, so they cannot be aligned"
    rays = camera.grid_rays[both]
    return align_robustly(
        rays * ranges[both, None], rays * true[both, None],
        scale=alignment != "rigid", rotation=alignment != "scale",
    )  # fmt: skip


def _reached(
    truth: RayCaster, true_range: Floats, camera: CameraModel, lighting: Lighting | None
) -> NDArray[np.bool_]:
    """Return the (H, W) pixels whose true point the projector lights."""
    visible = np.isfinite(true_range)
    if lighting is None:
        return visible
    points = camera.grid_rays[visible] * true_range[visible, None]
    q = lighting.projector.project(lighting.projector_from_camera.apply(points))
    on_pattern = ((q >= -0.5) & (q <= np.array(lighting.size) - 0.5)).all(-1)
    centre = lighting.projector_from_camera.inverse().t
    towards = points - centre
    length = np.linalg.norm(towards, axis=-1)
    first = truth.range(centre, towards / length[:, None])
    # A miss is a point on the rim of the mesh that rounding let pass.
    shadowed = first < length * (1 - _SHADOW_TOLERANCE)
    lit = visible.copy()
    lit[visible] = on_pattern & ~shadowed
    return lit

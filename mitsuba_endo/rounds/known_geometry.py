"""What a calibration says of a frame's geometry, for reading its photograph again."""

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..initialisation.epipolar_residual import bearings, residuals
from ..initialisation.triangulate import ranges, smooth_depth
from ..records.correspondence import CorrespondenceMap
from ..records.solution import Solution
from ..refine.epipolar_sweep import KnownGeometry


def known_geometry(
    solution: Solution, camera: CameraModel, map_: CorrespondenceMap
) -> KnownGeometry | None:
    """Return the geometry of the map's frame, lengths in the solution's unit.

    None where the calibration left the frame out or could not determine a value of it.

    Args:
        solution: of a calibration.
        camera: which saw the frame.
        map_: of the frame, named as in the solution; its coordinates give the ranges.
    """
    frame = next((f for f in solution.frames if f.name == map_.name), None)
    if frame is None:
        return None
    own = solution.projector
    if frame.focal is not None:
        own = own.model_copy(update={"focal": frame.focal})
    projector, pose = own.to_model(), frame.projector_from_camera.to_transform()
    if projector is None or pose is None:
        return None
    return KnownGeometry(camera, projector, pose, _ranges(map_, camera, projector, pose))


def _ranges(
    map_: CorrespondenceMap, camera: CameraModel, projector: ProjectorModel, pose: RigidTransform
) -> NDArray[np.float64]:
    """Return the range image (H, W) triangulated from a map, medians over 5 x 5; NaN = none."""
    out = np.full(map_.valid.shape, np.nan)
    rays = camera.grid_rays
    use = map_.valid & np.isfinite(rays).all(-1)
    pattern_bearings = bearings(projector, map_.q[use].astype(np.float64).T)
    from_camera, from_projector, _ = ranges(
        pose, pattern_bearings, residuals(pose, rays[use].T, pattern_bearings)
    )
    front = np.isfinite(from_camera) & (from_camera > 0) & (from_projector > 0)
    out[use] = np.where(front, from_camera, np.nan)
    return smooth_depth(out)

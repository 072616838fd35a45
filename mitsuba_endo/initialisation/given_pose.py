"""The start from a calibration that is already known or guessed well, or from its pose alone."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform

from .choose import robust_scale
from .correspondences import Correspondences, checked_map, gather
from .depth_image import depth_image
from .epipolar_refinement import evaluate
from .outlier_rejection import clean_map
from .relative_pose_ransac import ladder
from .result import Start
from .triangulate import in_front


def known_start(
    q: NDArray[np.floating],
    camera: CameraModel,
    projector: ProjectorModel,
    pose: RigidTransform,
    usable: NDArray[np.bool_] | None = None,
) -> Start:
    """Triangulate one map under a given calibration.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        camera: the camera that saw the map.
        projector: with a focal length.
        pose: projector_from_camera, any unit of length.
        usable: (H, W) correspondences that the cleaning kept, where it was done already.

    Raises:
        InputError: too few usable correspondences, or a map and camera of different size.
    """
    q = checked_map(q, camera)
    pose = RigidTransform(pose.R, pose.t / np.linalg.norm(pose.t))
    data = gather(q, clean_map(q) if usable is None else usable, camera)
    image = depth_image(evaluate(pose, projector, data), data, (camera.height, camera.width))
    return Start(projector, pose, image.depth, image.used, image.scale_px)


def start_at_pose(
    q: NDArray[np.floating],
    camera: CameraModel,
    projector: ProjectorModel,
    pose: RigidTransform,
    size: tuple[int, int],
) -> Start:
    """Triangulate one map under a given pose and the focal length that suits it best.

    Focal lengths of the ladder are compared by the robust scale of the epipolar residuals, those
    that put points behind a device set back; the best is refined between its neighbours.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        camera: the camera that saw the map.
        projector: its focal length is replaced.
        pose: projector_from_camera, any unit of length.
        size: pattern width and height, pixels.

    Raises:
        InputError: too few usable correspondences, or a map and camera of different size.
    """
    q = checked_map(q, camera)
    pose = RigidTransform(pose.R, pose.t / np.linalg.norm(pose.t))
    usable = clean_map(q)
    data = gather(q, usable, camera)

    def misfit(log_focal: float) -> float:
        return _misfit(data, projector.with_(focal=float(np.exp(log_focal))), pose)

    rungs = np.log(ladder(projector, size[0], data))
    best = int(np.argmin([misfit(x) for x in rungs]))
    ends = rungs[max(best - 1, 0)], rungs[min(best + 1, len(rungs) - 1)]
    fitted = minimize_scalar(misfit, bounds=ends, method="bounded", options={"xatol": 1e-4})
    return known_start(q, camera, projector.with_(focal=float(np.exp(fitted.x))), pose, usable)


def _misfit(data: Correspondences, projector: ProjectorModel, pose: RigidTransform) -> float:
    """Return the robust residual scale over the share of points before both devices."""
    at = evaluate(pose, projector, data)
    scale = robust_scale(at)
    sign = in_front(pose, at.bearings, at.at, scale / float(projector.focal))
    return scale / max(float(np.mean(sign >= 0)), 1e-3)

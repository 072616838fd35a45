"""The published start: a plane before the camera and a projector that looks the same way."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform

from .choose import robust_scale
from .correspondences import checked_map, gather
from .epipolar_refinement import evaluate
from .outlier_rejection import clean_map
from .result import Start


def plane_start(
    q: NDArray[np.floating],
    camera: CameraModel,
    projector: ProjectorModel,
    *,
    distance: float,
    direction: Sequence[float] = (-1.0, 0.0, 0.0),
) -> Start:
    """Start from the plane z = ``distance`` and a front-parallel projector: R = I, t = direction.

    Nothing is estimated: the focal length is the projector's.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
        camera: the camera that saw the map.
        projector: with a focal length.
        distance: of the plane along the camera's optical axis, baselines.
        direction: of t in X_proj = R X_cam + t, any length; the default is that of a projector to
            the right of the camera.

    Raises:
        InputError: too few usable correspondences, a focal length, distance or direction that
            has no meaning, or a map and camera of different size.
    """
    t = np.asarray(direction, np.float64)
    _check(projector.focal, distance, t)
    q = checked_map(q, camera)
    data = gather(q, clean_map(q), camera)
    pose = RigidTransform.of(np.eye(3), t / np.linalg.norm(t))
    before = data.rays[2] > 0
    depth = np.full(q.shape[:2], np.nan)
    depth.flat[data.pixel[before]] = distance / data.rays[2, before]
    return Start(
        projector=projector,
        projector_from_camera=pose,
        depth=depth,
        used=np.isfinite(depth),
        scale_px=robust_scale(evaluate(pose, projector, data)),
    )


def _check(focal: float | None, distance: float, t: NDArray[np.float64]) -> None:
    if focal is None or not (np.isfinite(focal) and focal > 0):
        raise InputError(
            f"the plane start needs a focal length, not {focal}",
            where="projector.focal.value",
            todo="give it in pattern pixels or use the start 'search'",
        )
    if not (np.isfinite(distance) and distance > 0):
        raise InputError(
            f"the plane's distance {distance} is not a positive number",
            todo="give it in baselines",
        )
    if t.shape != (3,) or not np.isfinite(t).all() or not t.any():
        raise InputError(
            f"the direction {t.tolist()} of the projector is not a vector",
            todo="give three finite numbers that are not all zero",
        )

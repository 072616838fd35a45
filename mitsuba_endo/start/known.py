"""The start from a calibration that is already known or guessed well."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.laws import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform

from .choose import robust_scale
from .clean import clean_map
from .correspondences import checked_map, gather
from .refine import evaluate
from .result import Start
from .triangulate import ranges

_KEEP = 5.0
"""Correspondences within this many residual scales of their epipolar curve are used."""


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
    state = evaluate(pose, projector, data)
    scale = robust_scale(state)
    at_camera, at_projector, _ = ranges(pose, state.seen, state.at)
    keep = (np.abs(state.r) <= _KEEP * scale) & (at_camera > 0) & (at_projector > 0)
    keep &= np.isfinite(at_camera)
    depth = np.full(q.shape[:2], np.nan)
    depth.flat[data.pixel[keep]] = at_camera[keep]
    return Start(projector, pose, depth, np.isfinite(depth), scale)

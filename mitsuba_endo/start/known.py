"""The start from a calibration that is already known or guessed well."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.laws import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform

from .clean import clean_map
from .correspondences import checked_map, gather
from .depth_image import depth_image
from .refine import evaluate
from .result import Start


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
    seen = depth_image(evaluate(pose, projector, data), data, (camera.height, camera.width))
    return Start(projector, pose, seen.depth, seen.used, seen.scale_px)

"""How a wrong pose of the projector bends the way of the camera.

A wrong pose distorts every range image alike, seen from its camera. When the camera moves on, the
same places are distorted otherwise, and the frame that fits best is turned and shifted by a little
more than the camera was. An error of the baseline's length alone makes the way longer in
proportion; the other five bend it.
"""

import numpy as np
from numpy.typing import NDArray

from ..fusion import Volume
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..initialisation.vectors import dot
from .linearise import Poses, Triangulated, against_map, range_response
from .view import PixelSample

Floats = NDArray[np.float64]


def camera_by_projector(
    sample: PixelSample,
    triangulated: Triangulated,
    poses: Poses,
    before: RigidTransform,
    projector: ProjectorModel,
    volume: Volume,
) -> Floats:
    """Return the step of the camera (6, 6) that a step of the projector's pose makes by a motion.

    Args:
        sample: of a frame.
        triangulated: its points.
        poses: where it is.
        before: world_from_camera of an earlier frame.
        projector: with its focal length.
        volume: the map, which gives the normals.
    """
    residuals = against_map(sample, triangulated, poses.world_from_camera, volume)
    rays = residuals.by_poses[6:]  # w . (X x n) + dt . n
    here = residuals.cosine * triangulated.range_by_pose
    points = sample.rays * triangulated.range
    motion = before.inverse() @ poses.world_from_camera
    earlier = motion.R @ points + motion.t[:, None]
    normal = motion.R @ rays[3:]
    cosine = dot(normal, earlier) / np.sqrt(dot(earlier, earlier))
    there = cosine * range_response(projector, poses.projector_from_camera, earlier)
    A = (rays * residuals.observed) @ rays.T
    A[np.arange(6), np.arange(6)] += 1e-9 * np.trace(A)
    step: Floats = np.linalg.solve(A, (rays * residuals.observed) @ (there - here).T).astype(
        np.float64
    )
    return step

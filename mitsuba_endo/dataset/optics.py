"""Drawing cameras, projectors, and the projector's pose in the channel."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.cameras import CAMERAS, CameraModel
from ..geometry.endoscope import aimed_projector
from ..geometry.projection_models import ProjectorModel, projector_model
from ..geometry.transforms import RigidTransform
from .config import CameraRanges, ProjectorRanges

CAMERA_TRIES = 50
"""Cameras drawn before the ranges are refused: by then fewer than one in ten can be used."""


def draw_camera(ranges: CameraRanges, rng: np.random.Generator) -> CameraModel:
    """Return a camera whose lens model can be inverted in the whole image.

    Raises:
        InputError: none was drawn; the distortion folds the image.
    """
    for _ in range(CAMERA_TRIES):
        model = ranges.model.draw(rng)
        half = np.radians(ranges.fov.draw(rng)) / 2
        cx, cy = (
            (size - 1) / 2 + ranges.centre.draw(rng) for size in (ranges.width, ranges.height)
        )
        aspect = ranges.aspect.draw(rng)
        distortion = tuple(float(k.draw(rng)) for k in ranges.distortion)
        fx = ranges.width / 2 / CAMERAS[model].reach(distortion, half)
        K = np.array([[fx, 0, cx], [0, fx * aspect, cy], [0, 0, 1]])
        camera = CameraModel(model, ranges.width, ranges.height, K, distortion)
        if _invertible(camera):
            return camera
    raise InputError(
        f"folds the image's corners in {CAMERA_TRIES} of {CAMERA_TRIES} cameras",
        "camera.distortion",
        "narrow the range of its coefficients, or of fov",
    )


def _invertible(camera: CameraModel) -> bool:
    pixels = camera.pixel_grid()
    border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    return bool(np.isfinite(camera.rays(border)).all())


def draw_projector(
    ranges: ProjectorRanges, size: tuple[int, int], rng: np.random.Generator
) -> ProjectorModel:
    """Return a projector for a pattern of this width and height, pattern pixels."""
    centre = [(n - 1) / 2 + ranges.centre.draw(rng) for n in size]
    distortion = [float(k.draw(rng)) for k in ranges.distortion]
    return projector_model(
        ranges.law.draw(rng), ranges.focal.draw(rng), centre, ranges.aspect.draw(rng), distortion
    )


def draw_projector_pose(ranges: ProjectorRanges, rng: np.random.Generator) -> RigidTransform:
    """Return a projector_from_camera, mm, of a projector in the channel beside the camera."""
    bearing = np.radians(ranges.bearing.draw(rng))
    baseline = ranges.baseline.draw(rng)
    centre = np.array(
        [baseline * np.cos(bearing), baseline * np.sin(bearing), ranges.ahead.draw(rng)]
    )
    target = [0.0, 0.0, centre[2] + ranges.meeting.draw(rng)]
    angles = [ranges.tilt.draw(rng), ranges.tilt.draw(rng), ranges.roll.draw(rng)]
    return aimed_projector(centre, target, rotation_from_angles(angles))


def rotation_from_angles(degrees: Sequence[float]) -> NDArray[np.float64]:
    """Return the rotation (3, 3) about the x axis, then the new y axis, then the new z axis."""
    return Rotation.from_euler("XYZ", degrees, degrees=True).as_matrix()

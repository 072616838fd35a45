"""Where frames see the points of a surface: pixels of the camera and of the pattern."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...reading.regular import is_file
from ...records.solution import Frame
from ..read_folder import read_observed

Floats = NDArray[np.float64]

_AGREE = 5.0
"""Residual, in RMS residuals of the frame, up to which a correspondence is that of the point."""


@dataclass(frozen=True, eq=False)
class Sightings:
    """Which points a frame sees, and where."""

    points: NDArray[np.int64]
    """(N,) indices."""
    pixels: Floats
    """(N, 2) in the camera's image."""
    q: Floats
    """(N, 2) observed projector coordinates there, pattern pixels."""
    error: Floats
    """(N,) distance of ``q`` from where the point is projected, pattern pixels."""


def sightings(
    points: Floats,
    frame: Frame,
    camera: CameraModel,
    projector: ProjectorModel,
    camera_from_world: RigidTransform,
    projector_from_camera: RigidTransform,
    observed: Path,
) -> Sightings:
    """Find the points (P, 3) of the world in a frame's correspondences.

    A point is seen where the used correspondences around its pixel, interpolated, agree with its
    projection into the pattern: that of a hidden point is another. None are where there is no map.
    """
    if not is_file(observed):
        nowhere = np.zeros((0, 2))
        return Sightings(np.zeros(0, np.int64), nowhere, nowhere, np.zeros(0))
    q, used = read_observed(observed)
    in_camera = camera_from_world.apply(points)
    front = in_camera[:, 2] > 0
    pixels = np.where(
        front[:, None], camera.project(np.where(front[:, None], in_camera, [0, 0, 1])), -9
    )
    interpolated = _interpolated(np.where(used[..., None], q, np.nan), pixels)
    error = np.linalg.norm(
        interpolated - projector.project(projector_from_camera.apply(in_camera)), axis=-1
    )
    kept = np.flatnonzero(front & (error < _AGREE * (frame.rms_px or 1.0)))
    return Sightings(kept, pixels[kept], interpolated[kept], error[kept])


def _interpolated(image: NDArray[np.float32], pixels: Floats) -> Floats:
    """Return an image (H, W, 2) at pixels (N, 2), bilinear; NaN beside missing pixels."""
    x, y = (np.ascontiguousarray(c, np.float32) for c in pixels.T)
    values = cv2.remap(
        image.astype(np.float32), x[:, None], y[:, None], cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan, np.nan, np.nan, np.nan),
    )  # fmt: skip
    return values.reshape(-1, 2).astype(np.float64)

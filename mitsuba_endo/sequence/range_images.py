"""The range image that a placed frame adds to the map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fusion import RangeFrame
from ..geometry.projection_models import ProjectorModel
from .linearise import Poses, Triangulated, triangulate
from .placement import FAR
from .view import PixelSample, ThinnedMap

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ranged:
    """All usable correspondences of a frame, triangulated."""

    frame: RangeFrame
    pixels: NDArray[np.int_]
    """(N,) flat indices of the usable pixels."""
    sample: PixelSample
    """Their correspondences."""
    triangulated: Triangulated
    """Their points."""


def ranged(view: ThinnedMap, poses: Poses, projector: ProjectorModel, noise: float) -> Ranged:
    """Triangulate a frame; pixels far off their epipolar lines are not seen.

    Args:
        view: the frame.
        poses: where it is.
        projector: with its focal length.
        noise: of a coordinate, pattern pixels.
    """
    pixels = np.flatnonzero(view.usable)
    sample = view.correspondences(projector, pixels)
    triangulated = triangulate(sample, projector, poses.projector_from_camera)
    on_lines = triangulated.good & (np.abs(triangulated.across) < FAR * noise)
    shape = view.usable.shape
    range_, weight = np.full(shape, np.nan), np.zeros(shape)
    range_.ravel()[pixels[on_lines]] = triangulated.range[on_lines]
    weight.ravel()[pixels[on_lines]] = triangulated.pixels_per_length[on_lines] ** 2
    frame = RangeFrame(range_, view.camera, poses.world_from_camera, weight)
    return Ranged(frame, pixels, sample, triangulated)

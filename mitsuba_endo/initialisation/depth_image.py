"""Depth of a map's correspondences under a calibration."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .choose import robust_scale
from .correspondences import Correspondences
from .epipolar_refinement import EpipolarState
from .triangulate import ranges

KEEP = 5.0
"""Correspondences within this many residual scales of their epipolar curve are used."""


@dataclass(frozen=True, eq=False)
class DepthImage:
    """What a calibration makes of a map."""

    depth: NDArray[np.float64]
    """(H, W) range along the unit camera ray, in the unit of t; NaN = not used."""
    scale_px: float
    """Robust scale of the epipolar residuals, pattern pixels."""

    @property
    def used(self) -> NDArray[np.bool_]:
        """(H, W) correspondences near their epipolar curve and in front of both devices."""
        return np.isfinite(self.depth)


def depth_image(state: EpipolarState, data: Correspondences, shape: tuple[int, int]) -> DepthImage:
    """Triangulate correspondences.

    Args:
        state: the calibration, evaluated at ``data``.
        data: correspondences of the map.
        shape: height and width of the map.
    """
    scale = robust_scale(state)
    at_camera, at_projector, _ = ranges(state.pose, state.bearings, state.at)
    keep = (np.abs(state.r) <= KEEP * scale) & (at_camera > 0) & (at_projector > 0)
    keep &= np.isfinite(at_camera)
    depth = np.full(shape, np.nan)
    depth.flat[data.pixel[keep]] = at_camera[keep]
    return DepthImage(depth, scale)

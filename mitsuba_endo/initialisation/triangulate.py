"""Depth along camera rays from a calibrated camera-projector pair."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.transforms import RigidTransform

from .epipolar_residual import Bearings, Residuals
from .outlier_rejection import median_filter
from .vectors import Vectors, cross, dot, skew


def ranges(
    pose: RigidTransform, pattern_bearings: Bearings, at: Residuals
) -> tuple[Vectors, Vectors, Vectors]:
    """Intersect camera rays with the bearings moved onto their epipolar planes.

    The noise is in q alone, so q is first moved to the nearest point of its epipolar curve; then
    both rays meet exactly, and lambda R d + t = mu b gives, with c = b x R d,
    lambda = (t x b) . c / |c|^2 and mu = (t x R d) . c / |c|^2.

    Args:
        pose: projector_from_camera.
        pattern_bearings: bearings of N pattern coordinates.
        at: their residuals at ``pose``.

    Returns:
        (N,) range along the unit camera ray, (N,) range along the unit bearing, both in the unit
        of t and signed, and (N,) the sine of the angle between the two rays.
    """
    b = pattern_bearings.b - at.r * (
        at.unit_slope[0] * pattern_bearings.b_u + at.unit_slope[1] * pattern_bearings.b_v
    )
    b = b / np.sqrt(dot(b, b))
    c = cross(b, at.turned)
    square = dot(c, c) + 1e-300
    camera = dot(skew(pose.t) @ b, c) / square
    projector = dot(skew(pose.t) @ at.turned, c) / square
    return camera, projector, np.sqrt(square)


def in_front(
    pose: RigidTransform, pattern_bearings: Bearings, at: Residuals, noise_angle: float
) -> Vectors:
    """Return (N,) +1 for points in front of camera and projector, -1 behind either, 0 undecided.

    Rays closer to parallel than the noise tell nothing about the sign of the depth.

    Args:
        noise_angle: angle that the noise of q makes up, radians.
    """
    camera, projector, parallax = ranges(pose, pattern_bearings, at)
    sign = np.where((camera > 0) & (projector > 0), 1.0, -1.0)
    return np.where(np.isfinite(camera) & (parallax > noise_angle), sign, 0.0)


def smooth_depth(depth: NDArray[np.float64], size: int = 5) -> NDArray[np.float64]:
    """Return the median-filtered depth (H, W), the surface's start; NaN stays NaN.

    The median is taken over the inverse, in which the noise of a triangulated depth is even.

    Args:
        depth: (H, W) positive, any unit, NaN = missing.
        size: side of the window, 3 or 5 pixels.
    """
    finite = np.isfinite(depth)
    if not finite.any():
        return depth.copy()
    inverse = np.where(finite, 1 / np.where(finite, depth, 1.0), 0.0)
    smooth = median_filter(inverse[..., None], finite, size)[..., 0].astype(np.float64)
    return np.where(finite, 1 / np.where(finite, smooth, 1.0), np.nan)

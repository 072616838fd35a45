"""Epipolar residual of a camera-projector pair for any projection model.

A correspondence is a unit camera ray d and a pattern coordinate q with bearing b(q) in the
projector frame. With Y = lambda R d + t the three vectors b, t and R d are coplanar:

    e(q) = b(q) . (t x R d) = 0.

The noise is in q, so the residual is e / |de/dq|, the distance in pattern pixels from q to its
epipolar curve (first order; exact for an undistorted pinhole). Its scale and that of b and t
cancel. Source: Sampson's distance (Hartley and Zisserman, Multiple View Geometry, 11.4.3).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.brown_distortion import BrownDistortion
from mitsuba_endo.geometry.projection_models import PROJECTION_MODELS, ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform, tangent_basis

from .vectors import Vectors, cross, dot, skew

# Central differences of O(1) functions in double precision are best near the cube root of epsilon.
_LAW_STEP = 6e-6
_LOG_FOCAL_STEP = 1e-6
"""Forward difference: it errs by some 1e-6 of itself, and by 1e-7 from :data:`_UNDISTORTED`."""
_UNDISTORTED = 1e-13  # residual of normalised coordinates, a few rounding errors


@dataclass(frozen=True, eq=False)
class Bearings:
    """Directions of pattern coordinates in the projector frame and their derivatives."""

    b: Vectors
    """(3, N), not unit length; NaN outside the law's range."""
    b_u: Vectors
    """(3, N) derivative with respect to q's first component, per pattern pixel."""
    b_v: Vectors
    """(3, N) derivative with respect to q's second component, per pattern pixel."""
    normalised: tuple[Vectors, Vectors]
    """The law's normalised coordinates (N,) each, from which a nearby focal length starts."""

    def take(self, index: NDArray) -> "Bearings":
        """Return the bearings at ``index`` (integers or a mask)."""
        x, y = self.normalised
        return Bearings(
            self.b[:, index], self.b_u[:, index], self.b_v[:, index], (x[index], y[index])
        )


@dataclass(frozen=True, eq=False)
class Residuals:
    """Epipolar residuals and what their derivatives share."""

    r: Vectors
    """(N,) pattern pixels; NaN where the bearing is."""
    slope: Vectors
    """(N,) |de/dq|."""
    unit_slope: tuple[Vectors, Vectors]
    """de/dq / |de/dq|."""
    turned: Vectors
    """(3, N) R d."""


def bearings(projector: ProjectorModel, q: Vectors, near: Bearings | None = None) -> Bearings:
    """Return the bearings of q (2, N), pattern pixels.

    The distortion's Jacobian is analytic; the law's is a central difference, so that a new law
    needs no derivative.

    Args:
        near: bearings of the same q at another focal length, which save most of the work of
            inverting the distortion.
    """
    law, distortion = PROJECTION_MODELS[projector.law], projector.distortion
    fx, fy = projector.focal, projector.focal * projector.aspect
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        x, y = _undistorted(
            distortion, (q[0] - projector.centre[0]) / fx, (q[1] - projector.centre[1]) / fy, near
        )
        jxx, jxy, jyy = distortion.jacobian(x, y)
        det = jxx * jyy - jxy * jxy
        b = np.stack(law.direction(x, y))
        h = _LAW_STEP
        b_x = np.subtract(law.direction(x + h, y), law.direction(x - h, y)) / (2 * h)
        b_y = np.subtract(law.direction(x, y + h), law.direction(x, y - h)) / (2 * h)
        # d(x, y)/dq is the inverse of the distortion's symmetric Jacobian over the focal lengths.
        b_u = (jyy * b_x - jxy * b_y) / (det * fx)
        b_v = (jxx * b_y - jxy * b_x) / (det * fy)
    return Bearings(b, b_u, b_v, (x, y))


def _undistorted(
    distortion: BrownDistortion, a: Vectors, b: Vectors, near: Bearings | None
) -> tuple[Vectors, Vectors]:
    """Undo the distortion by Newton's method from nearby values, or from scratch where it fails."""
    if near is None or not len(distortion.coefficients):
        return distortion.remove(a, b)
    x, y = near.normalised
    for _ in range(5):
        da, db = distortion.apply(x, y)
        ra, rb = da - a, db - b
        if max(np.abs(ra).max(), np.abs(rb).max()) < _UNDISTORTED:
            return x, y
        jxx, jxy, jyy = distortion.jacobian(x, y)
        det = jxx * jyy - jxy * jxy
        x, y = x - (jyy * ra - jxy * rb) / det, y - (jxx * rb - jxy * ra) / det
    return distortion.remove(a, b)


def residuals(pose: RigidTransform, rays: Vectors, pattern_bearings: Bearings) -> Residuals:
    """Return the epipolar residuals of camera rays (3, N) and their bearings.

    Args:
        pose: projector_from_camera; the length of t is irrelevant.
    """
    turned = pose.R @ rays
    normal = skew(pose.t) @ turned
    e = dot(pattern_bearings.b, normal)
    e_u, e_v = dot(pattern_bearings.b_u, normal), dot(pattern_bearings.b_v, normal)
    # At the epipole every direction fits: a tiny floor makes that 0 / floor instead of 0 / 0.
    slope = np.sqrt(e_u * e_u + e_v * e_v) + 1e-100
    return Residuals(e / slope, slope, (e_u / slope, e_v / slope), turned)


def pose_jacobian(pose: RigidTransform, pattern_bearings: Bearings, at: Residuals) -> Vectors:
    """Return dr/dp (6, N) for p = (w, dt) with R' = exp([w]x) R and t' = t + dt.

    With s = r grad(e)/|grad(e)| the derivative of e/|grad e| is that of e with b replaced by
    b - B s, all over |grad e|.
    """
    corrected = pattern_bearings.b - at.r * (
        at.unit_slope[0] * pattern_bearings.b_u + at.unit_slope[1] * pattern_bearings.b_v
    )
    corrected /= at.slope
    t = pose.t
    # b . (t x (w x d)) = w . (b (t . d) - t (b . d)) with d the turned ray.
    of_rotation = corrected * (t @ at.turned) - t[:, None] * dot(corrected, at.turned)
    # b . (dt x d) = dt . (d x b)
    return np.concatenate([of_rotation, cross(at.turned, corrected)])


def jacobian(
    pose: RigidTransform,
    projector: ProjectorModel,
    rays: Vectors,
    q: Vectors,
    pattern_bearings: Bearings,
    at: Residuals,
    refine_focal: bool,
) -> Vectors:
    """Return dr/dp (P, N) for p = (w, t's two tangent directions[, log focal]).

    The chart is R' = exp([w]x) R and t' = t + T p with T = ``tangent_basis(t)``, |t| = 1. The focal
    column is a forward difference: it needs second derivatives of the law.
    """
    rows = np.empty((5 + refine_focal, at.r.size))
    of_pose = pose_jacobian(pose, pattern_bearings, at)
    rows[:3], rows[3:5] = of_pose[:3], tangent_basis(pose.t).T @ of_pose[3:]
    if refine_focal:
        nudged = projector.with_(focal=projector.focal * np.exp(_LOG_FOCAL_STEP))
        rows[5] = (
            residuals(pose, rays, bearings(nudged, q, pattern_bearings)).r - at.r
        ) / _LOG_FOCAL_STEP
    return rows

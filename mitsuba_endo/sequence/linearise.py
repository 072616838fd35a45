"""What a frame's correspondences say of its poses, linearised.

A correspondence is two numbers. Across its epipolar line it tells of the projector's pose alone;
along it, of the range. With the map S held, the residual R(S, C, P) - q is whitened in these two
directions: the epipolar residual, and the distance of the triangulated point to the map. Where the
map ends the second is missing, and the first still counts.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..fusion import Volume
from ..fusion.interpolate import interpolate
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..initialisation.epipolar_residual import residuals
from ..initialisation.triangulate import ranges
from ..initialisation.vectors import cross, dot
from .view import PixelSample

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_STEP = 1e-6
"""Of numerical derivatives of the projection, relative to the distance."""
_CLEAR_GRADIENT = 0.3
"""Length of the signed distance's gradient below which it has no direction; 1 on a clean wall."""


@dataclass(frozen=True)
class Poses:
    """Where camera and projector of one frame are; lengths are the map's."""

    world_from_camera: RigidTransform
    projector_from_camera: RigidTransform

    def moved(self, step: Floats) -> "Poses":
        """Return poses after a step (12,): the projector's six, the camera's in its own axes."""
        turned = RigidTransform.identity().perturbed(step[6:])
        return Poses(
            orthonormal(self.world_from_camera @ turned),
            orthonormal(self.projector_from_camera.perturbed(step[:6])),
        )


def orthonormal(pose: RigidTransform) -> RigidTransform:
    """Return a pose without the rounding errors of its rotation.

    A prediction of constant velocity multiplies them from frame to frame.
    """
    return RigidTransform(Rotation.from_matrix(pose.R).as_matrix(), pose.t)


@dataclass(frozen=True, eq=False)
class Triangulated:
    """Points on the camera's rays, and how they depend on the projector's pose."""

    good: Bools
    """(N,) before both devices."""
    range: Floats
    """(N,) along the unit ray."""
    pixels_per_length: Floats
    """(N,) how far the coordinate moves with the range: pattern pixels a unit of length."""
    across: Floats
    """(N,) epipolar residual, pattern pixels."""
    by_pose: Floats
    """(7, N) derivative of minus ``across``: by the projector's pose (6) and the log of its focal
    length."""
    range_by_pose: Floats
    """(6, N) derivative of ``range``."""


def triangulate(
    sample: PixelSample, projector: ProjectorModel, pose: RigidTransform
) -> Triangulated:
    """Triangulate correspondences under a pose, projector_from_camera."""
    at = residuals(pose, sample.rays, sample.bearings)
    along, lit, _ = ranges(pose, sample.bearings, at)
    good = np.isfinite(along) & (along > 0) & (lit > 0)
    distance = np.where(good, along, 1.0)
    turned = at.turned * distance
    Y = turned + pose.t[:, None]
    good &= Y[2] > 0
    Y = np.where(good, Y, np.array([[0.0], [0.0], [1.0]]))
    q, gradient = _projection(projector, Y)
    slope, tangent = _along(gradient, at.turned)
    normal = np.stack([-tangent[1], tangent[0]])
    focal = dot2(normal, q - np.array(projector.centre, float)[:, None])
    return Triangulated(
        good, distance, slope, dot2(normal, sample.q - q),
        np.concatenate([_by_pose(gradient, normal, turned), focal[None]]),
        -_by_pose(gradient, tangent, turned) / slope,
    )  # fmt: skip


def range_response(projector: ProjectorModel, pose: RigidTransform, points: Floats) -> Floats:
    """Return how ranges found at points (3, N) of the camera's frame depend on the pose (6, N)."""
    turned = pose.R @ points
    _, gradient = _projection(projector, turned + pose.t[:, None])
    slope, tangent = _along(gradient, turned / np.sqrt(dot(turned, turned)))
    return -_by_pose(gradient, tangent, turned) / slope


def _along(gradient: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Return how fast (N,) and where to (2, N) coordinates go with the range along rays (3, N)."""
    by_range = np.einsum("ijn,jn->in", gradient, rays)
    slope = np.sqrt((by_range**2).sum(0)) + 1e-12
    return slope, by_range / slope


def _by_pose(gradient: Floats, direction: Floats, turned: Floats) -> Floats:
    """Return the derivative (6, N) of coordinates along directions (2, N) by turn and shift.

    d q / d (turn, shift) = G [-(R X) x, 1]: a row g of G gives (R X) x g and g.
    """
    g = np.einsum("in,ijn->jn", direction, gradient)
    return np.concatenate([cross(turned, g), g])


def dot2(a: Floats, b: Floats) -> Floats:
    return a[0] * b[0] + a[1] * b[1]


def _projection(projector: ProjectorModel, Y: Floats) -> tuple[Floats, Floats]:
    """Return coordinates (2, N) of directions Y (3, N), and their derivatives (2, 3, N)."""
    h = _STEP * np.sqrt(dot(Y, Y))
    gradient = np.empty((2, 3, Y.shape[1]))
    for axis in range(3):
        ends = []
        for sign in (1, -1):
            moved = Y.copy()
            moved[axis] += sign * h
            ends.append(np.stack(projector.project_xyz(*moved)))
        gradient[:, axis] = (ends[0] - ends[1]) / (2 * h)
    return np.stack(projector.project_xyz(*Y)), gradient


@dataclass(frozen=True, eq=False)
class AgainstMap:
    """Distances of triangulated points to the map."""

    observed: Bools
    """(N,) where the map is known."""
    distance: Floats
    """(N,) signed, along the map's normal."""
    cosine: Floats
    """(N,) of the angle between ray and normal, with sign."""
    by_poses: Floats
    """(12, N) derivative of ``distance``."""


def against_map(
    sample: PixelSample, triangulated: Triangulated, camera: RigidTransform, volume: Volume
) -> AgainstMap:
    """Compare triangulated points with the map, the camera at world_from_camera."""
    points = sample.rays * triangulated.range
    at = interpolate(volume, camera.apply(points.T))
    normal = camera.R.T @ at.gradient.T
    length = np.sqrt(dot(normal, normal))
    observed = at.observed & triangulated.good & (length > _CLEAR_GRADIENT)
    normal = normal / np.where(length > 0, length, 1.0)
    cosine = dot(normal, sample.rays)
    own = np.concatenate([cross(points, normal), normal])
    return AgainstMap(
        observed, at.distance / np.where(observed, length, 1.0), cosine,
        np.concatenate([cosine * triangulated.range_by_pose, own]),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class CoordinatesAt:
    """Where points on the camera's rays appear in the pattern."""

    good: Bools
    """(N,) before the projector."""
    q: Floats
    """(2, N) pattern pixels."""
    slope: Floats
    """(N,) how far the coordinate moves with the range."""
    tangent: Floats
    """(2, N) unit, in which direction."""
    gradient: Floats
    """(2, 3, N) of coordinates by points of the projector's frame."""
    turned: Floats
    """(3, N) points in the projector's axes, from the camera's centre."""
    centre: Floats
    """(2, 1) of the projection."""

    @property
    def normal(self) -> Floats:
        """(2, N) unit, across the tangent."""
        return np.stack([-self.tangent[1], self.tangent[0]])

    def by_pose(self, direction: Floats) -> Floats:
        """Return the derivative (6, N) along directions (2, N) by the projector's pose."""
        return _by_pose(self.gradient, direction, self.turned)

    def by_focal(self, direction: Floats) -> Floats:
        """Return the derivative (1, N) along directions (2, N) by the log of the focal length."""
        return dot2(direction, self.q - self.centre)[None]


def coordinates_at(
    projector: ProjectorModel, pose: RigidTransform, rays: Floats, range_: Floats
) -> CoordinatesAt:
    """Project points at ranges (N,) along rays (3, N), the projector at projector_from_camera."""
    along = pose.R @ rays
    turned = along * range_
    Y = turned + pose.t[:, None]
    good = Y[2] > 0
    q, gradient = _projection(projector, np.where(good, Y, np.array([[0.0], [0.0], [1.0]])))
    slope, tangent = _along(gradient, along)
    centre = np.array(projector.centre, float)[:, None]
    return CoordinatesAt(good, q, slope, tangent, gradient, turned, centre)

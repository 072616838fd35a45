"""R(S, C, P) at one pixel: from a camera ray over the surface to the projector coordinate.

The only place where a point becomes a pattern coordinate; ``ray_triangle`` tells where a ray meets
the surface. Components are Dr.Jit scalars of one entry a pixel; what is differentiated is up to
whoever made them.
"""

from dataclasses import dataclass
from typing import Any, Protocol

from ..geometry.cameras import CameraModel
from ..geometry.transforms import RigidTransform
from .mitsuba_modules import dr, mi


class Projects(Protocol):
    """What takes a direction in the projector's frame to a pattern coordinate."""

    def project_xyz(self, x: Any, y: Any, z: Any) -> tuple[Any, Any]: ...


@dataclass(frozen=True, eq=False)
class FrameModel:
    """Camera C and projector P of one frame; values of NumPy or of Dr.Jit."""

    camera: CameraModel
    world_from_camera: Any
    """:class:`RigidTransform` or :class:`Pose`."""
    projector_from_camera: Any
    projector: Projects


@dataclass(frozen=True, eq=False)
class Pose:
    """x_out = exp([turn]x) R x_in + t + shift to first order, on Dr.Jit vectors."""

    R: Any
    """(3, 3) matrix."""
    t: Any
    """Translation, ``shift`` included."""
    turn: Any = None
    """Rotation vector, zero in value, whose derivative is that of the rotation; None = fixed."""

    @classmethod
    def of(cls, pose: RigidTransform, tangent: Any = ()) -> "Pose":
        """Lift a pose; ``tangent`` holds six scalars (turn, shift) of value zero, or none.

        Values become opaque, so that kernels are not compiled anew for each pose.
        """
        R = mi.Matrix3d(pose.R.tolist())
        t = mi.Vector3d(*(mi.Float64(float(x)) for x in pose.t))
        dr.make_opaque(R, t)
        if not len(tangent):
            return cls(R, t)
        return cls(R, t + mi.Vector3d(*tangent[3:]), mi.Vector3d(*tangent[:3]))

    def rotate(self, direction: Any) -> Any:
        """Rotate a vector."""
        turned = self.R @ direction
        return turned if self.turn is None else turned + dr.cross(self.turn, turned)


def project_along(model: FrameModel, direction: Any, distance: Any) -> tuple[Any, Any, Any]:
    """Return the coordinate (u, v) of the point ``distance`` along a camera ray, and a mask.

    Args:
        model: camera and projector.
        direction: unit ray in the camera's frame.
        distance: along it.

    Returns:
        Pattern pixels, and whether the point lies in front of the projector; (u, v) is finite and
        without meaning where it does not.
    """
    pose = model.projector_from_camera
    # Projection models ignore the length of their argument; over the distance it stays near one.
    Y = pose.rotate(direction) + pose.t / distance
    return project_direction(model.projector, Y.x, Y.y, Y.z)


def project_direction(
    projector: Projects, x: Any, y: Any, z: Any, least_cosine: float = 0.0
) -> tuple[Any, Any, Any]:
    """Return the coordinate (u, v) of directions in the projector's frame, and a mask.

    Args:
        projector: its intrinsics.
        x: first component of directions of any length.
        y: second component.
        z: along the optical axis.
        least_cosine: cosine of the largest angle to the axis that counts as in front.

    Returns:
        Pattern pixels, finite and without meaning where the mask, in front of it, is false.
    """
    # Without a limit the length is not needed, and its derivative is not traced.
    front = z > (least_cosine * dr.sqrt(x * x + y * y + z * z) if least_cosine else 0)
    u, v = projector.project_xyz(x, y, dr.select(front, z, 1.0))
    return u, v, front


def camera_rays(camera: CameraModel, u: Any, v: Any) -> Any:
    """Return the unit ray of pixels (u, v), differentiable with respect to the intrinsics."""
    x, y, z = camera.direction_uv(u, v)
    return dr.normalize(mi.Vector3d(x, y, z))

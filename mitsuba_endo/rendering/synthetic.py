"""Exact correspondences of a mesh, for any poses, without a scene file."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from .mitsuba_modules import mi
from .moving_mesh import MovingMesh, cast_into, vector
from .projector_coordinates import FrameModel, Pose, project_along
from .ray_triangle import distances

_TOUCHES = 1e-3
"""Share of the distance within which a ray ends at the point it was sent to, not before it."""


@dataclass(frozen=True, eq=False)
class ExactView:
    """What an ideal decoder would find."""

    q: NDArray[np.float64]
    """(H, W, 2) pattern pixels, NaN where the camera or the projector does not see the surface."""
    points: NDArray[np.float64]
    """(H, W, 3) points seen, in the camera's frame; NaN where there is none."""


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays meet a mesh."""

    points: NDArray[np.float64]
    """(N, 3) in the world, computed in double precision; meaningless without a hit."""
    triangle: NDArray[np.int64]
    """(N,) index of the face; 0 without a hit."""
    normals: NDArray[np.float64]
    """(N, 3) of the face, twice its area long, as its winding has it."""
    hit: NDArray[np.bool_]
    """(N,)."""

    def from_behind(self, origin: NDArray[np.float64]) -> float:
        """Return the share of the hits that rays from ``origin`` (3,) have on faces' backs."""
        directions, normals = self.points[self.hit] - origin, self.normals[self.hit]
        away = np.einsum("ni,ni->n", normals, directions) > 0
        return float(away.mean()) if len(away) else 0.0


class MeshScene:
    """A mesh in the world, of which views give correspondences."""

    def __init__(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], scene: Any = None
    ) -> None:
        """Keep the mesh, mm, and make a scene of it unless there is one.

        Args:
            vertices: (V, 3).
            faces: (F, 3).
            scene: the ``mi.Scene`` whose only shape is this mesh with its faces in this order.
        """
        self._vertices, self._faces = vertices, faces
        self._cast: Callable[[Any, Any], tuple[Any, Any]] = (
            MovingMesh(vertices, faces).cast if scene is None else partial(cast_into, scene)
        )

    def view(
        self,
        camera: CameraModel,
        world_from_camera: RigidTransform,
        projector: ProjectorModel,
        projector_from_camera: RigidTransform,
        size: tuple[int, int] | None = None,
    ) -> ExactView:
        """Return the correspondences of one frame.

        Args:
            camera: which sees.
            world_from_camera: its pose.
            projector: which lights.
            projector_from_camera: its pose relative to the camera.
            size: pattern (width, height); coordinates outside are missing. None: no limit.
        """
        hits = self.through_pixels(camera, world_from_camera)
        points, hit = hits.points, hits.hit
        camera_from_world = world_from_camera.inverse()
        world_from_projector = world_from_camera @ projector_from_camera.inverse()
        at = camera_from_world.apply(points)
        q = self._coordinates(camera, at, projector, projector_from_camera)
        lit = hit & np.isfinite(q).all(1) & self.reaches(world_from_projector.t, points)
        if size is not None:
            lit &= ((q >= -0.5) & (q <= np.array(size) - 0.5)).all(1)
        shape = (camera.height, camera.width)
        return ExactView(
            np.where(lit[:, None], q, np.nan).reshape(*shape, 2),
            np.where(hit[:, None], at, np.nan).reshape(*shape, 3),
        )

    @staticmethod
    def _coordinates(
        camera: CameraModel,
        points: NDArray[np.float64],
        projector: ProjectorModel,
        projector_from_camera: RigidTransform,
    ) -> NDArray[np.float64]:
        """Return (N, 2) coordinates of points (N, 3) in the camera's frame, NaN behind."""
        distance = np.linalg.norm(points, axis=1)
        here, pose = Pose.of(RigidTransform.identity()), Pose.of(projector_from_camera)
        model = FrameModel(camera, here, pose, projector)
        directions = vector(points / distance[:, None])
        u, v, front = project_along(model, directions, mi.Float64(distance))
        return np.where(front.numpy()[:, None], np.stack([u.numpy(), v.numpy()], -1), np.nan)

    def through_pixels(self, camera: CameraModel, world_from_camera: RigidTransform) -> Hits:
        """Follow the rays through all pixels' centres, row by row."""
        directions = world_from_camera.rotate(camera.grid_rays.reshape(-1, 3))
        return self.cast(world_from_camera.t, directions)

    def cast(self, origin: NDArray[np.float64], directions: NDArray[np.float64]) -> Hits:
        """Follow rays from an origin (3,), or one for each (N, 3), along directions (N, 3)."""
        triangle, hit = self._cast(
            vector(np.broadcast_to(origin, directions.shape)), vector(directions)
        )
        index = triangle.numpy().astype(np.int64)
        corners = self._vertices[self._faces[index]]
        distance = distances(corners, origin, directions)
        sides = corners[:, 1:] - corners[:, :1]
        return Hits(
            origin + distance[:, None] * directions,
            index,
            np.cross(sides[:, 0], sides[:, 1]),
            hit.numpy() & np.isfinite(distance),
        )

    def reaches(
        self, origin: NDArray[np.float64], points: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Tell which points (N, 3) of the mesh are seen from ``origin`` (3,)."""
        offsets = np.nan_to_num(points - origin, nan=1.0)
        distance = np.linalg.norm(offsets, axis=1)
        met = self.cast(origin, offsets / distance[:, None])
        reached = np.linalg.norm(np.nan_to_num(met.points) - origin, axis=1)
        return ~met.hit | (reached > distance * (1 - _TOUCHES))

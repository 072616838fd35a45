"""Camera poses before a surface: one sampler for each kind of surface."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..geometry.transforms import RigidTransform, tangent_basis
from ..rendering.synthetic import MeshScene
from ..shapes.colon import Colon
from ..shapes.mesh import Mesh
from .optics import rotation_from_angles
from .scene_ranges import ViewRanges

Array = NDArray[np.float64]
DIRECTIONS = 64
"""Rays that look for the way along a lumen of unknown shape: they lie about 15 degrees apart, below
the drawn tilt's default range."""
STEP_MM = 2.0
"""Along a colon's centre line, over which its direction is taken: well below a fold's spacing."""
OFF_WALL_MM = 1e-3
"""Distance from a wall at which a ray starts, lest it meets that wall."""


class ViewSampler(Protocol):
    """Draws camera poses before one surface."""

    def draw(self, view: ViewRanges, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        """Return a world_from_camera, which may turn out to be unfit."""
        ...


@dataclass(frozen=True)
class SheetViews:
    """Before a surface that lies around (0, 0, distance) and faces the origin."""

    distance: float

    def draw(self, view: ViewRanges, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        about = _tilt(view, rng)
        target = np.array([0.0, 0.0, self.distance])
        return RigidTransform(about @ _turn(view, rng), target - about @ target)


@dataclass(frozen=True, eq=False)
class LumenViews:
    """Inside a colon, looking along it."""

    colon: Colon
    along: float
    """Of the camera, along the centre line, mm."""

    def draw(self, view: ViewRanges, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        centre, ahead = (self._middle(self.along + step) for step in (0.0, STEP_MM))
        axes = _facing_matrix(ahead - centre)
        side = rng.uniform(-np.pi, np.pi)
        off = view.off_axis.draw(rng) * self.colon.radius
        offset = axes @ np.array([off * np.cos(side), off * np.sin(side), 0.0])
        return RigidTransform(axes @ _tilt(view, rng) @ _turn(view, rng), centre + offset)

    def _middle(self, along: float) -> Array:
        """Return the mean (3,) of the wall's ring at a length of the centre line, mm."""
        angle = np.linspace(-np.pi, np.pi, 24, endpoint=False)
        return self.colon.wall(np.full_like(angle, along), angle).mean(0)


@dataclass(frozen=True, eq=False)
class MeshViews:
    """Before, around or inside any mesh whose faces point to where the camera may be."""

    mesh: Mesh
    side: Literal["front", "outside", "inside"]

    def draw(self, view: ViewRanges, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        point, normal = self._point(rng)
        if self.side == "inside":
            return self._inside(view, rng, scene, point, normal)
        about = _facing_matrix(-normal) @ _tilt(view, rng)
        away = view.distance.draw(rng)
        return RigidTransform(about @ _turn(view, rng), point - away * about[:, 2])

    def _point(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return a point of the surface, every one equally likely, and its unit normal."""
        a, b, c = (self.mesh.vertices[self.mesh.faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area = np.linalg.norm(normal, axis=1)
        face = int(rng.choice(len(area), p=area / area.sum()))
        u, v = rng.random(2)
        if u + v > 1:
            u, v = 1 - u, 1 - v
        point = a[face] + u * (b[face] - a[face]) + v * (c[face] - a[face])
        return point, normal[face] / area[face]

    def _inside(
        self,
        view: ViewRanges,
        rng: np.random.Generator,
        scene: MeshScene,
        point: Array,
        normal: Array,
    ) -> RigidTransform:
        """Stand between a point of the wall and the opposite one, looking where it is far."""
        start = point + OFF_WALL_MM * normal
        opposite = scene.cast(start, normal[None])
        away = 2 * view.distance.draw(rng)
        across = float(np.linalg.norm(opposite.points[0] - start)) if opposite.hit[0] else away
        off = view.off_axis.draw(rng)
        centre = start + normal * min(across, away) * (0.5 + 0.5 * off * rng.choice([-1, 1]))
        rays = rng.standard_normal((DIRECTIONS, 3))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        hits = scene.cast(centre, rays)
        reach = np.where(hits.hit, np.linalg.norm(hits.points - centre, axis=1), 0.0)
        about = _facing_matrix(rays[int(np.argmax(reach))])
        return RigidTransform(about @ _tilt(view, rng) @ _turn(view, rng), centre)


def _facing_matrix(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is along ``axis`` (3,)."""
    across = tangent_basis(axis)
    return np.column_stack([across, axis / np.linalg.norm(axis)])


def _tilt(view: ViewRanges, rng: np.random.Generator) -> Array:
    """Return a rotation by the drawn tilt about a random axis across z."""
    bearing = rng.uniform(-np.pi, np.pi)
    axis = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    return Rotation.from_rotvec(np.radians(view.tilt.draw(rng)) * axis).as_matrix()


def _turn(view: ViewRanges, rng: np.random.Generator) -> Array:
    """Return the camera's own rotation about x, y, then its optical axis."""
    return rotation_from_angles([view.turn.draw(rng), view.turn.draw(rng), view.roll.draw(rng)])

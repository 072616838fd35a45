"""From where a surface is looked at: one way of drawing camera poses for each kind of surface."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..geometry.transforms import RigidTransform, tangent_basis
from ..rendering.synthetic import MeshScene
from ..shapes.colon import Colon
from ..shapes.mesh import Mesh
from .config import View

Array = NDArray[np.float64]
DIRECTIONS = 64
"""Directions tried for the way along a lumen of unknown shape."""


class Stance(Protocol):
    """A way of standing before a surface."""

    def place(self, view: View, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        """Return a drawn world_from_camera, which may turn out to be unfit."""
        ...


@dataclass(frozen=True)
class Facing:
    """Before a surface that lies around (0, 0, distance) and faces the origin."""

    distance: float

    def place(self, view: View, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        about = _tilt(view, rng)
        target = np.array([0.0, 0.0, self.distance])
        return RigidTransform(about @ _turn(view, rng), target - about @ target)


@dataclass(frozen=True, eq=False)
class InLumen:
    """Inside a colon, looking along it."""

    colon: Colon
    at: float
    """Place on the centre line, mm."""

    def place(self, view: View, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
        centre, ahead = (self._middle(self.at + step) for step in (0.0, 2.0))
        along = _facing_matrix(ahead - centre)
        side = rng.uniform(-np.pi, np.pi)
        off = view.off_axis.draw(rng) * self.colon.radius
        offset = along @ np.array([off * np.cos(side), off * np.sin(side), 0.0])
        return RigidTransform(along @ _tilt(view, rng) @ _turn(view, rng), centre + offset)

    def _middle(self, along: float) -> Array:
        """Return the mean of the wall's ring at a place on the centre line (3,), mm."""
        angle = np.linspace(-np.pi, np.pi, 24, endpoint=False)
        return self.colon.wall(np.full_like(angle, along), angle).mean(0)


@dataclass(frozen=True, eq=False)
class OnMesh:
    """Before, around or inside any mesh whose faces point to where the camera may be."""

    mesh: Mesh
    side: Literal["front", "outside", "inside"]

    def place(self, view: View, rng: np.random.Generator, scene: MeshScene) -> RigidTransform:
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
        at = int(rng.choice(len(area), p=area / area.sum()))
        u, v = rng.random(2)
        if u + v > 1:
            u, v = 1 - u, 1 - v
        return a[at] + u * (b[at] - a[at]) + v * (c[at] - a[at]), normal[at] / area[at]

    def _inside(
        self, view: View, rng: np.random.Generator, scene: MeshScene, point: Array, normal: Array
    ) -> RigidTransform:
        """Stand between a point of the wall and the opposite one, looking where it is far."""
        start = point + 1e-3 * normal
        met = scene.cast(start, normal[None])
        away = 2 * view.distance.draw(rng)
        across = float(np.linalg.norm(met.points[0] - start)) if met.hit[0] else away
        off = view.off_axis.draw(rng)
        place = start + normal * min(across, away) * (0.5 + 0.5 * off * rng.choice([-1, 1]))
        ways = rng.standard_normal((DIRECTIONS, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        found = scene.cast(place, ways)
        reach = np.where(found.hit, np.linalg.norm(found.points - place, axis=1), 0.0)
        about = _facing_matrix(ways[int(np.argmax(reach))])
        return RigidTransform(about @ _tilt(view, rng) @ _turn(view, rng), place)


def _facing_matrix(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is along ``axis`` (3,)."""
    across = tangent_basis(axis)
    return np.column_stack([across, axis / np.linalg.norm(axis)])


def _tilt(view: View, rng: np.random.Generator) -> Array:
    """Return a rotation by the drawn tilt about a random axis across z."""
    bearing = rng.uniform(-np.pi, np.pi)
    axis = np.array([np.cos(bearing), np.sin(bearing), 0.0])
    return Rotation.from_rotvec(np.radians(view.tilt.draw(rng)) * axis).as_matrix()


def _turn(view: View, rng: np.random.Generator) -> Array:
    """Return the camera's own rotation about x, y, then its optical axis."""
    angles = [view.turn.draw(rng), view.turn.draw(rng), view.roll.draw(rng)]
    return Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()

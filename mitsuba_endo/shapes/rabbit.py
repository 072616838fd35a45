"""A sitting rabbit: the closed object with ears, edges and self-occlusion."""

import numpy as np
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass
from scipy.spatial.transform import Rotation

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.grid import check_size, planar_uv
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.registry import CHECKED, Finite, Positive, register
from mitsuba_endo.shapes.sdf import (
    ellipsoid,
    rounded_cone,
    smooth_difference,
    smooth_union,
)
from mitsuba_endo.shapes.surface_nets import mesh_field

Array = NDArray[np.float64]

LOW, HIGH = np.array([-28.0, -2.5, -20.0]), np.array([27.0, 67.0, 20.0])
"""Corners of a box around it, in its own frame: x to the nose, y up, z to its left."""
MIDDLE = np.array([0.0, 32.0, 0.0])
"""Point that is put on the camera's axis, in its own frame."""
UNITS_HIGH = 66.0
"""From the feet to the tips of the ears, in the figure's units."""


@register("rabbit")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class Rabbit:
    """A rabbit sitting up, turned three quarters to the camera, as one smooth closed solid.

    Texture coordinates are the slide projection along z, so the back repeats the front.
    """

    distance: Positive = 75.0
    """z of the figure's middle, mm."""

    height: Positive = 60.0
    """Length from the feet to the tips of the ears, mm."""

    yaw: Finite = 0.65
    """Rotation about the vertical, rad: 0 looks to the camera, pi/2 to the right (+x)."""

    edge: Positive = 0.6
    """Side of the meshing grid's cell, mm. The default gives about 40,000 triangles."""

    def __post_init__(self) -> None:
        if self.edge > self.height / 25:
            raise self._too_coarse("its limbs would be lost")

    def mesh(self) -> Mesh:
        """Build the figure."""
        scale = self.height / UNITS_HIGH
        area = 1.4 * self.height**2  # measured on the figure
        check_size(2 * area / self.edge**2, "rabbit")
        check_size(float(np.prod((HIGH - LOW) * scale / self.edge)) / 4, "rabbit")
        try:
            figure = mesh_field(rabbit_field, LOW, HIGH, self.edge / scale)
        except ValueError as error:
            raise self._too_coarse(str(error)) from None
        turn = Rotation.from_euler("y", -self.yaw).as_matrix()
        # x (nose) to -z, y (up) to -y, z (its left) to -x: it looks at the camera.
        camera_from_figure = turn @ np.array([[0, 0, -1], [0, -1, 0], [-1, 0, 0]])
        vertices = scale * (figure.vertices - MIDDLE) @ camera_from_figure.T
        vertices += [0.0, 0.0, self.distance]
        return Mesh(vertices, figure.faces, planar_uv(vertices))

    def _too_coarse(self, reason: str) -> InputError:
        return InputError(
            f"{self.edge:g} mm is too coarse for a figure {self.height:g} mm high ({reason})",
            where="rabbit: edge",
            todo="choose about a hundredth of the height",
        )


def rabbit_field(points: Array) -> Array:
    """Return the signed distance (...) to the figure at points (..., 3) in its own frame."""
    # Left and right mirror each other, so only one ear, eye, leg and paw are written down. The
    # mirror is rounded: plain |z| would leave a crease where the halves meet.
    half = np.concatenate([points[..., :2], np.hypot(points[..., 2:], 1.0)], axis=-1)
    return smooth_union(_body(half), _head(half), 3.0)


def _body(p: Array) -> Array:
    trunk = ellipsoid((-5, 15, 0), (15, 15.5, 12), Rotation.from_euler("z", 0.35))(p)
    chest = ellipsoid((6, 19, 0), (8.5, 13, 8.5), Rotation.from_euler("z", 0.15))(p)
    haunch = ellipsoid((-8, 10.5, 8.5), (10.5, 11, 5.5), Rotation.from_euler("z", -0.2))(p)
    hind_foot = rounded_cone((-10, 1.6, 10), (7, 1.2, 10.5), 3.2, 2.9)(p)
    foreleg = rounded_cone((9, 16, 4.2), (12.5, 2.2, 4.5), 3.6, 2.6)(p)
    paw = ellipsoid((14.2, 1.2, 4.6), (4.2, 2.5, 2.8))(p)
    tail = ellipsoid((-21, 8, 0), (4.6, 4.8, 4.8))(p)
    solid = smooth_union(trunk, chest, 8.0)
    solid = smooth_union(solid, haunch, 4.0)
    solid = smooth_union(solid, hind_foot, 4.0)
    solid = smooth_union(solid, smooth_union(foreleg, paw, 2.5), 3.5)
    return smooth_union(solid, tail, 2.5)


def _head(p: Array) -> Array:
    skull = ellipsoid((8, 36, 0), (9.8, 8.8, 8.2), Rotation.from_euler("z", -0.2))(p)
    muzzle = ellipsoid((14.8, 33.3, 0), (5.8, 4.8, 5.0))(p)
    cheek = ellipsoid((11, 33, 4.2), (5, 4.4, 4.0))(p)
    nose = ellipsoid((19.7, 34.9, 0), (1.2, 1.0, 1.6))(p)
    eye = ellipsoid((11.6, 38.2, 6.7), (2.2, 2.2, 1.5), Rotation.from_euler("yx", [0.45, -0.3]))(p)
    solid = smooth_union(skull, muzzle, 5.0)
    solid = smooth_union(solid, cheek, 2.5)
    solid = smooth_union(solid, nose, 1.0)
    solid = smooth_union(solid, eye, 1.2)
    return smooth_union(solid, _ear(p), 3.0)


def _ear(p: Array) -> Array:
    # Leaning back and outward; the hollow opens forward and outward.
    lean = Rotation.from_euler("zx", [0.16, 0.22])
    middle = np.array([3.6, 53.5, 6.2])
    blade = ellipsoid(middle, (2.4, 13.0, 4.4), lean)(p)
    hollow = ellipsoid(middle + lean.apply([2.9, 0.8, 0.2]), (2.1, 9.0, 2.7), lean)(p)
    return smooth_difference(blade, hollow, 1.0)

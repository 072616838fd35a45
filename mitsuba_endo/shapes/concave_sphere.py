"""The inside of a sphere."""

import numpy as np
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass

from mitsuba_endo.shapes.grid import check_size, grid_mesh, sphere_patch
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.registry import CHECKED, HalfAngle, Positive, register


@register("concave_sphere")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class ConcaveSphere:
    """A four-sided piece of a hollow sphere, seen from inside or from before its opening."""

    distance: Positive = 70.0
    """z of the deepest point, mm."""

    radius: Positive = 55.0
    """Radius of the sphere, mm."""

    angle_x: HalfAngle = 0.8
    """Half-angle from left to right, seen from the sphere's centre, rad."""

    angle_y: HalfAngle = 0.75
    """Half-angle from top to bottom, seen from the sphere's centre, rad."""

    edge: Positive = 0.6
    """Length of a grid cell's side, mm. The default gives about 40,000 triangles."""

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) centre of the sphere, mm."""
        return np.array([0.0, 0.0, self.distance - self.radius])

    def mesh(self) -> Mesh:
        """Build the patch."""
        edge_angle = self.edge / self.radius
        check_size(8 * self.angle_x * self.angle_y / edge_angle**2, "concave_sphere")
        directions, _ = sphere_patch(self.angle_x, self.angle_y, edge_angle)
        return grid_mesh(self.centre + self.radius * directions)

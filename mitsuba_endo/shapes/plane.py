"""A flat sheet."""

import numpy as np
from pydantic.dataclasses import dataclass

from mitsuba_endo.shapes.grid import grid_axes, grid_mesh
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.registry import CHECKED, Positive, Tilt, register


@register("plane")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class Plane:
    """A rectangle in front of the camera, optionally tilted about its centre."""

    distance: Positive = 70.0
    """z of the centre, mm."""

    width: Positive = 80.0
    """Length of the side that lies along x before tilting, mm."""

    height: Positive = 80.0
    """Length of the side that lies along y before tilting, mm."""

    tilt_x: Tilt = 0.0
    """Rotation about the x axis, rad: positive moves the lower side away from the camera."""

    tilt_y: Tilt = 0.0
    """Rotation about the y axis, rad, after `tilt_x`: positive brings the right side nearer."""

    edge: Positive = 0.565
    """Length of a grid cell's side, mm. The default gives about 40,000 triangles."""

    def mesh(self) -> Mesh:
        """Build the rectangle."""
        x, y = grid_axes(self.width, self.height, self.edge, "plane")
        # R_y R_x (x, y, 0), right-handed rotations.
        z = y * np.sin(self.tilt_x)
        y = y * np.cos(self.tilt_x)
        c, s = np.cos(self.tilt_y), np.sin(self.tilt_y)
        x, z = c * x + s * z, -s * x + c * z
        return grid_mesh(np.stack([x, y, z + self.distance], axis=-1))

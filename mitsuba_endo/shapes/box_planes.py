"""The inside corner of a box."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.dataclasses import dataclass
from scipy.spatial.transform import Rotation

from mitsuba_endo.shapes.grid import cells, check_size, grid_faces, planar_uv
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.registry import CHECKED, Finite, Positive, register

Lean = Annotated[float, Field(ge=-0.5, le=0.5, allow_inf_nan=False)]


@register("box_planes")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class BoxPlanes:
    """Three rectangles at right angles that meet in a corner, the corner furthest away.

    The faces share the vertices of the box's edges: render it with face normals, or the edges
    look rounded.
    """

    distance: Positive = 90.0
    """z of the corner, mm."""

    size_a: Positive = 75.0
    """Length of the first edge that leaves the corner, mm."""

    size_b: Positive = 65.0
    """Length of the second edge, mm."""

    size_c: Positive = 70.0
    """Length of the third edge, mm."""

    roll: Finite = 0.3
    """Rotation of the box about the viewing axis, rad."""

    lean_x: Lean = 0.1
    """Rotation about the x axis away from the symmetric view, rad."""

    lean_y: Lean = -0.15
    """Rotation about the y axis away from the symmetric view, rad."""

    edge: Positive = 0.87
    """Length of a grid cell's side, mm. The default gives about 40,000 triangles."""

    def edge_directions(self) -> NDArray[np.float64]:
        """Return (3, 3): one unit vector a row, along the edges from the corner to the camera."""
        # Seen along its diagonal a box's three edges are 120 degrees apart and rise equally.
        turn = -2 * np.pi / 3 * np.arange(3)  # in this order faces look at the camera
        flat, rise = np.sqrt(2 / 3), np.sqrt(1 / 3)
        diagonal = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.full(3, -rise)], axis=1)
        return Rotation.from_euler("zxy", [self.roll, self.lean_x, self.lean_y]).apply(diagonal)

    def mesh(self) -> Mesh:
        """Build the corner."""
        sizes = np.array([self.size_a, self.size_b, self.size_c])
        check_size(2 * float(sizes @ np.roll(sizes, 1)) / self.edge**2, "box_planes")
        counts = [cells(size, self.edge) for size in sizes]
        # Integer grid coordinates (i, j, k) along the three edges: equal ones are one vertex.
        lattice, faces = [], []
        start = 0
        for first in range(3):
            second = (first + 1) % 3
            rows, columns = counts[first] + 1, counts[second] + 1
            cell = np.zeros((rows, columns, 3), dtype=np.int64)
            cell[..., first] = np.arange(rows)[:, None]
            cell[..., second] = np.arange(columns)[None, :]
            lattice.append(cell.reshape(-1, 3))
            faces.append(grid_faces(rows, columns) + start)
            start += rows * columns
        unique, index = np.unique(np.concatenate(lattice), axis=0, return_inverse=True)
        along = unique / counts * sizes
        vertices = along @ self.edge_directions() + [0.0, 0.0, self.distance]
        return Mesh(vertices, index.reshape(-1)[np.concatenate(faces)], planar_uv(vertices))

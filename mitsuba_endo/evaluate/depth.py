"""Where camera rays meet a mesh."""

import numpy as np
from numpy.typing import NDArray

from .. import backend
from ..geometry.cameras import CameraModel

Floats = NDArray[np.float64]


class RayCaster:
    """Casts rays at one triangle mesh: Mitsuba finds the triangle, whose plane is then met.

    So the range is exact to double precision although the search runs in single precision. A ray
    exactly along an edge between two triangles may slip through, as in every Mitsuba rendering.
    """

    def __init__(self, vertices: Floats, faces: NDArray[np.int64]) -> None:
        backend.ensure()
        from ..rendering.moving_mesh import MovingMesh

        self._mesh = MovingMesh(vertices, faces)
        self._corners = vertices[faces]

    def range(self, origin: Floats, directions: Floats) -> Floats:
        """Return the distance (N,) from ``origin`` (3,) along unit directions (N, 3); NaN = miss.

        Same frame and unit as the vertices.
        """
        return self.meet(origin, directions)[0]

    def meet(self, origin: Floats, directions: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Return the distance, as :meth:`range`, and the face (N,) that is met, 0 for a miss."""
        import mitsuba as mi

        from ..rendering.ray_triangle import distances

        start = mi.Point3f(origin.astype(np.float32))
        index, hit = self._mesh.cast(start, mi.Vector3f(directions.T.astype(np.float32)))
        triangle = np.array(index).astype(np.int64)
        distance = distances(self._corners[triangle], origin, directions)
        return np.where(np.array(hit).astype(bool), distance, np.nan), triangle


def range_image(caster: RayCaster, camera: CameraModel) -> Floats:
    """Return the distance (H, W) from the camera centre along each pixel's ray; NaN = miss.

    The mesh is in the camera's frame.
    """
    rays = camera.grid_rays
    return caster.range(np.zeros(3), rays.reshape(-1, 3)).reshape(rays.shape[:2])

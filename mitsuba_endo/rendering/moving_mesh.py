"""A mesh whose vertices the solver moves."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import keys
from .mitsuba_modules import dr, mi


class MovingMesh:
    """One triangle mesh in a scene of its own; loaded once, because reloading scenes leaks."""

    def __init__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
        mesh: Any = mi.Mesh(keys.SURFACE, len(vertices), len(faces))
        parameters = mi.traverse(mesh)
        parameters[keys.FACES] = faces.astype(np.uint32).ravel()
        parameters[keys.VERTEX_POSITIONS] = vertices.astype(np.float32).ravel()
        parameters.update()
        self._scene: Any = mi.load_dict({"type": "scene", keys.SURFACE: mesh})
        self._parameters = mi.traverse(self._scene)
        self._key = keys.vertex_positions()

    def move(self, vertices: NDArray[np.float64]) -> None:
        """Set the (V, 3) vertex positions and rebuild the acceleration structure."""
        self._parameters[self._key] = vertices.astype(np.float32).ravel()
        self._parameters.update()

    def cast(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """Return (triangle index, hit) of rays given as Dr.Jit vectors of any precision."""
        return cast_into(self._scene, origin, direction)


def cast_into(scene: Any, origin: Any, direction: Any) -> tuple[Any, Any]:
    """Return (triangle index, hit) of rays into a scene of one mesh, as :meth:`MovingMesh.cast`."""
    ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction))
    intersection = scene.ray_intersect_preliminary(ray, coherent=True)
    hit = intersection.is_valid()
    return dr.select(hit, intersection.prim_index, 0), hit


def vector(values: NDArray[np.float64]) -> Any:
    """Return an (N, 3) array as a Dr.Jit vector."""
    return mi.Vector3d(*(np.ascontiguousarray(values[:, i], np.float64) for i in range(3)))

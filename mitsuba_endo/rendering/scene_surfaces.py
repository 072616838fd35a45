"""The surfaces of any Mitsuba scene, as one mesh."""

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..shapes.mesh import Mesh
from . import keys
from .scene import open_scene


def scene_mesh(source: str | Path) -> Mesh:
    """Return the mesh called ``surface``, or all meshes of the scene together, in the world.

    Materials, cameras and lights of the scene are left aside, and shapes that are not meshes.
    Mitsuba is started if no variant is active.

    Raises:
        InputError: no such file, a broken scene, or no triangle mesh in it.
    """
    from .mitsuba_modules import mi

    scene, _ = open_scene(source)
    meshes = [shape for shape in scene.shapes() if isinstance(shape, mi.Mesh)]
    named = [mesh for mesh in meshes if mesh.id() == keys.SURFACE]
    parts = [_arrays(mesh) for mesh in named or meshes]
    if not sum(len(faces) for _, faces in parts):
        raise InputError(
            "holds no triangle mesh", str(source), "give its surfaces as ply, obj or serialized"
        )
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    return Mesh(
        np.concatenate([vertices for vertices, _ in parts]),
        np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)]),
    )


def _arrays(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    from .mitsuba_modules import mi

    values = mi.traverse(mesh)
    vertices = np.array(values[keys.VERTEX_POSITIONS], np.float64).reshape(-1, 3)
    return vertices, np.array(values[keys.FACES], np.int64).reshape(-1, 3)

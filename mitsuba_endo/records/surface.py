"""The measured surface as a PLY file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..reading.mesh_files import read_mesh
from ..reading.npz import open_npz
from ..reading.regular import is_file
from .calibration import SurfaceEstimate

# Mitsuba asks for a postfix: it then offers the values as the mesh attribute `vertex_std`.
STD_PROPERTY = "std_0"
MODES = "surface_modes.npz"
"""The surfaces' modes, by the names of the surfaces' files; beside them."""
SURFACE = "surface.ply"
_LARGEST = 65_504.0
"""Of half precision; a mode beyond is of a direction that nothing determines."""


def own_surface_name(frame: int) -> str:
    """Return the file name of the surface of one frame, where frames do not share one."""
    return f"surface_{frame:02d}.ply" if frame else SURFACE


def save_surface(
    path: str | Path,
    surface: SurfaceEstimate,
    further: dict[str, NDArray[np.float32]] | None = None,
    colours: NDArray[np.uint8] | None = None,
) -> None:
    """Write a binary PLY with float32 positions and, where given, ``std_0`` for each vertex.

    Args:
        path: the file.
        surface: what to write.
        further: more numbers (V,) for each vertex, by the names of their properties.
        colours: (V, 3) RGB.

    Raises:
        InputError: the file cannot be written.
    """
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False, vertex_colors=colours)
    if surface.std is not None:
        mesh.vertex_attributes[STD_PROPERTY] = surface.std.astype(np.float32)
    for name, values in (further or {}).items():
        mesh.vertex_attributes[name] = values
    data: Any = mesh.export(file_type="ply", vertex_normal=False)
    with atomic_path(path) as aside:
        aside.write_bytes(data)


def save_modes(path: str | Path, surfaces: dict[str, SurfaceEstimate]) -> None:
    """Write the modes of surfaces by their file names, in half precision.

    Raises:
        InputError: the file cannot be written.
    """
    arrays: dict[str, Any] = {
        name: np.clip(surface.modes, -_LARGEST, _LARGEST).astype(np.float16)
        for name, surface in surfaces.items()
        if surface.modes is not None
    }
    with atomic_path(path) as aside:
        np.savez_compressed(aside, **arrays)


def load_with_modes(path: str | Path) -> SurfaceEstimate:
    """Read a surface of a solution folder with its modes, which older folders do not hold.

    Raises:
        InputError: as :func:`load_surface`, or the modes are damaged or of another surface.
    """
    path = Path(path)
    surface = load_surface(path)
    beside = path.with_name(MODES)
    if not is_file(beside):
        return surface
    with open_npz(beside, todo="calibrate again") as data:
        modes = data.get(path.name, (None, None)) if path.name in data else None
    if modes is not None and len(modes) != len(surface.vertices):
        raise InputError(f"is not that of {path.name}", str(beside), "calibrate again")
    return replace(surface, modes=None if modes is None else modes.astype(np.float64))


def load_surface(path: str | Path) -> SurfaceEstimate:
    """Read a triangle mesh (ply, stl, obj, off, glb); nothing is merged or reordered.

    Raises:
        InputError: missing file, another format, damage, or no triangles with finite vertices.
    """
    mesh = read_mesh(path)
    vertices, faces = np.array(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    # Vertices that no triangle has may be anywhere, also nowhere; they keep their numbers.
    vertices[~np.isfinite(vertices).all(1)] = vertices[faces[0, 0]]
    raw = mesh.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    names = getattr(getattr(raw, "dtype", None), "names", None) or raw or ()  # text: a mapping
    if raw is None or STD_PROPERTY not in names:
        return SurfaceEstimate(vertices, faces)
    std = np.asarray(raw[STD_PROPERTY])
    if std.shape != (len(vertices),) or std.dtype.kind not in "fiu":
        raise InputError(f"{STD_PROPERTY} is no number a vertex", str(path), "make it again")
    return SurfaceEstimate(vertices, faces, std.astype(np.float64))

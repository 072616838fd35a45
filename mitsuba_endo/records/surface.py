"""The measured surface as a PLY file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from ..errors import InputError
from ..files import DAMAGED_NPZ, atomic_path
from .calibration import SurfaceEstimate

# Mitsuba asks for a postfix: it then offers the values as the mesh attribute `vertex_std`.
STD_PROPERTY = "std_0"
MODES = "surface_modes.npz"
"""The surfaces' modes, by the names of the surfaces' files; beside them."""


def save_surface(path: str | Path, surface: SurfaceEstimate) -> None:
    """Write a binary PLY with float32 positions and, where given, ``std_0`` for each vertex.

    Raises:
        InputError: the file cannot be written.
    """
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    if surface.std is not None:
        mesh.vertex_attributes[STD_PROPERTY] = surface.std.astype(np.float32)
    data: Any = mesh.export(file_type="ply", vertex_normal=False)
    with atomic_path(path) as aside:
        aside.write_bytes(data)


def save_modes(path: str | Path, surfaces: dict[str, SurfaceEstimate]) -> None:
    """Write the modes of surfaces by their file names, in half precision.

    Raises:
        InputError: the file cannot be written.
    """
    arrays: dict[str, Any] = {
        name: surface.modes.astype(np.float16)
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
    if not beside.is_file():
        return surface
    try:
        # NumPy itself leaves a damaged file open.
        with beside.open("rb") as file, np.load(file, allow_pickle=False) as data:
            modes = data[path.name].astype(np.float64) if path.name in data else None
    except DAMAGED_NPZ:
        raise InputError("is not a readable npz file", str(beside), "calibrate again") from None
    if modes is not None and len(modes) != len(surface.vertices):
        raise InputError(f"is not that of {path.name}", str(beside), "calibrate again")
    return replace(surface, modes=modes)


def load_surface(path: str | Path) -> SurfaceEstimate:
    """Read a triangle mesh in any format that trimesh reads; nothing is merged or reordered.

    Raises:
        InputError: missing file, another format, or no triangles with finite vertices.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError("no such file", str(path), "check the path")
    try:
        mesh: Any = trimesh.load_mesh(path, process=False)
    except Exception:  # trimesh's readers raise whatever the damaged file leads them to
        raise InputError("is not a readable mesh", str(path), "make it again") from None
    faces = np.asarray(getattr(mesh, "faces", []), np.int64)
    if not len(faces) or not np.isfinite(mesh.vertices[faces]).all():
        raise InputError("holds no triangles with finite vertices", str(path), "make it again")
    raw = mesh.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    std = raw[STD_PROPERTY] if raw is not None and STD_PROPERTY in (raw.dtype.names or ()) else None
    return SurfaceEstimate(
        np.array(mesh.vertices, np.float64), faces, None if std is None else std.astype(np.float64)
    )

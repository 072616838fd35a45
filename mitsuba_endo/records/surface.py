"""The measured surface as a PLY file."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from ..errors import InputError
from ..files import atomic_path
from .calibration import SurfaceEstimate

# Mitsuba asks for a postfix: it then offers the values as the mesh attribute `vertex_std`.
STD_PROPERTY = "std_0"


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

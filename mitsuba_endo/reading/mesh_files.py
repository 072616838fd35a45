"""Files of meshes: their headers' counts are compared with their sizes before trimesh reads them.

PLY: http://paulbourke.net/dataformats/ply. STL: a header of 80 bytes, the number of triangles, and
50 bytes for each.
"""

import io
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from ..errors import InputError
from .regular import MESH, read_bytes

FORMATS = ("ply", "stl", "obj", "off", "glb")
"""What trimesh reads from one file, without others beside it and without archives."""
LARGEST = 1e9
"""Coordinates, mm: more is no surface, and its squares are no numbers of single precision."""
_HEAD = 65536
"""Bytes of a PLY file in which its header is sought. Chosen: headers take some hundred."""
_SIZES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4,
          "double": 8, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
          "float32": 4, "float64": 8}  # fmt: skip


def read_mesh(path: str | Path) -> Any:
    """Return a mesh as trimesh reads it; nothing is merged or reordered.

    Raises:
        InputError: missing, too large, of another format, damaged, without triangles, or with
            triangles whose vertices are not there or nowhere.
    """
    path = Path(path)
    kind = path.suffix.lower().removeprefix(".")
    data = read_bytes(path, MESH)
    if kind not in FORMATS:
        raise InputError(
            f"is no mesh of a known format ('{path.suffix}')", str(path),
            f"give one of {', '.join(FORMATS)}",
        )  # fmt: skip
    try:
        _check_header(data, kind)
        # From memory: trimesh would read whatever file an OBJ's material names.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of NumPy, about numbers that are refused below
            mesh: Any = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False)
            vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces)
    except Exception:  # trimesh's readers raise whatever the damaged file leads them to
        raise InputError("is not a readable mesh", str(path), "make it again") from None
    _check(vertices, faces, str(path))
    return mesh


def _check(vertices: Any, faces: Any, source: str) -> None:
    whole = faces.ndim == 2 and faces.shape[1] == 3 and vertices.ndim == 2 and len(faces)
    if not whole:
        raise InputError("holds no triangles with finite vertices", source, "make it again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError("has triangles without vertices", source, "make it again")
    used = vertices[faces]
    if not np.isfinite(used).all():
        raise InputError("holds no triangles with finite vertices", source, "make it again")
    if np.abs(used).max() > LARGEST:
        raise InputError(f"reaches farther than {LARGEST:g}", source, "give it in mm")


def _check_header(data: bytes, kind: str) -> None:
    if kind == "ply" and _least_ply(data[:_HEAD]) > len(data):
        raise ValueError("cut short")
    if kind == "stl" and data.lstrip()[:5].lower() != b"solid":
        (count,) = struct.unpack("<I", data[80:84])
        if 84 + 50 * count > len(data):
            raise ValueError("cut short")


def _least_ply(head: bytes) -> int:
    """Return how many bytes the elements of a PLY file take at least."""
    lines = head.partition(b"end_header")[0].decode("ascii", "replace").splitlines()
    text = any(line.startswith("format ascii") for line in lines)
    least, count = 0, 0
    for line in lines:
        words = line.split()
        if words[:1] == ["element"]:
            count = int(words[2])
            if count < 0:
                raise ValueError("a negative number of elements")
        elif words[:1] == ["property"]:
            size = _SIZES[words[2 if words[1] == "list" else 1]]
            least += count * (2 if text else size)
    return least

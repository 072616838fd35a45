"""The triangle mesh that every shape generator returns."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from mitsuba_endo.files import atomic_path


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in millimetres, in the scene's camera-like frame (x right, y down, z forward)."""

    vertices: NDArray[np.float64]
    """(V, 3) positions, mm."""

    faces: NDArray[np.int64]
    """(F, 3) vertex indices, counter-clockwise seen from the side the camera is on."""

    uv: NDArray[np.float64] | None = None
    """(V, 2) texture coordinates in [0, 1], or None."""

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) lowest and highest corner of the axis-aligned box, mm."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return the same vertices and faces as a trimesh object, nothing merged or reordered."""
        mesh = trimesh.Trimesh(self.vertices, self.faces, process=False)
        if self.uv is not None:
            for name, values in zip("uv", self.uv.T, strict=True):
                mesh.vertex_attributes[name] = values.astype(np.float32)
        return mesh

    def save(self, path: Path | str) -> None:
        """Write a binary PLY file (float32 positions, and u, v per vertex as Mitsuba reads them).

        The file appears complete or not at all.
        """
        with atomic_path(Path(path)) as aside:
            self.to_trimesh().export(aside, file_type="ply", vertex_normal=False)

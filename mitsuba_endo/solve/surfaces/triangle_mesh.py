"""A triangle mesh as the surface: X_i = X0_i + s_i n_i along fixed directions n_i.

It represents what no function of the direction from one camera can: the far side of folds, a whole
organ. Vertices are numbered by SciPy's reverse Cuthill-McKee order, which makes the normal matrix
banded; a banded Cholesky factorisation is then as fast as general sparse ones up to some 50,000
vertices, and gives the inverse's band for standard deviations.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import reverse_cuthill_mckee

from ...rendering.mitsuba_modules import dr, mi
from ...rendering.moving_mesh import vector
from .edge_bending import bending_operator
from .registry import register_surface
from .surface import Bending, Surface

Floats = NDArray[np.float64]

_FARTHEST = 0.5
"""Farthest way of a vertex from its anchor, in distances of the anchor from the eye."""


@register_surface
@dataclass(frozen=True, eq=False)
class TriangleMesh(Surface):
    """A mesh whose vertices move along lines."""

    kind = "mesh"
    anchors: Floats
    """(V, 3) X0, the world's frame, baselines."""
    directions: Floats
    """(V, 3) unit n."""
    distances: Floats
    """(V,) typical distance from which each vertex is seen, baselines."""
    faces: NDArray[np.int64]
    """(F, 3) vertex indices."""

    def record(self) -> dict[str, NDArray]:
        return {
            "anchors": self.anchors, "directions": self.directions,
            "distances": self.distances, "faces": self.faces,
        }  # fmt: skip

    @classmethod
    def from_record(cls, arrays: Mapping[str, NDArray]) -> "TriangleMesh":
        names = ("anchors", "directions", "distances", "faces")
        return cls(*(arrays[name] for name in names))

    @property
    def size(self) -> int:
        return len(self.anchors)

    def vertices(self, values: Floats) -> Floats:
        return self.anchors + values[:, None] * self.directions

    def slopes(self, values: Floats) -> Floats:
        return np.ones_like(values)

    def retract(self, values: Floats, step: Floats) -> Floats:
        farthest = _FARTHEST * self.distances
        return np.clip(values + step, -farthest, farthest)

    def corners(self, vertex: Any, value: Any, active: Any) -> Any:
        anchor = dr.gather(mi.Vector3d, self._anchors, vertex, active)
        return anchor + value * dr.gather(mi.Vector3d, self._directions, vertex, active)

    def bending(self, disparity: float) -> Bending:
        """Return bends across edges, of the disparity that a motion along n changes.

        A vertex at distance r has the disparity f b / r; moving by s along n changes it by about
        f b s / r^2, whichever way n points.
        """
        rows, corners = bending_operator(self.anchors, self.faces)
        scale = disparity / self.distances[corners].mean(1) ** 2
        rows = sp.diags_array(scale) @ rows
        normals = self._edge_normals(corners)
        # Along the edge's own normal: K (X0 + s n) . m = (K X0) . m + sum_i K_i (n_i . m) s_i.
        offset = np.einsum("ec,ec->e", rows @ self.anchors, normals)
        coo = sp.coo_array(rows)
        edge, vertex = coo.coords
        along = np.einsum("ic,ic->i", self.directions[vertex], normals[edge])
        operator = sp.csr_array((coo.data * along, (edge, vertex)), shape=rows.shape)
        return Bending(operator, offset)

    def bridges(self, values: Floats) -> NDArray[np.bool_]:
        """Return none: a mesh is fused from what was seen, without bridges."""
        return np.zeros(len(self.faces), bool)

    def coarsened(self, room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the vertices nearest to the middles of cubes, and the triangles that stay."""
        low, high = self.anchors.min(0), self.anchors.max(0)
        # A surface that fills a box crosses about the square of the cubes along its side.
        cube = float(np.prod(np.maximum(high - low, 1e-9)) ** (1 / 3)) / max(np.sqrt(room / 6), 1)
        cell = np.floor((self.anchors - low) / cube).astype(np.int64)
        _, first, member = np.unique(cell, axis=0, return_index=True, return_inverse=True)
        faces = member.reshape(-1)[self.faces]
        whole = (faces != np.roll(faces, 1, axis=1)).all(1)
        return first, np.unique(faces[whole], axis=0)

    @cached_property
    def _anchors(self) -> Any:
        return vector(self.anchors)

    @cached_property
    def _directions(self) -> Any:
        return vector(self.directions)

    def _edge_normals(self, corners: NDArray[np.int64]) -> Floats:
        """Return unit normals (E, 3) at edges: of the two triangles, together."""
        c, d, a, b = (self.anchors[corners[:, i]] for i in range(4))
        both = np.cross(b - a, c - a) - np.cross(b - a, d - a)
        return both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-300)


def triangle_mesh(
    vertices: Floats, faces: NDArray[np.int64], directions: Floats, distances: Floats
) -> tuple[TriangleMesh, NDArray[np.int64]]:
    """Return a mesh surface with its vertices in an order of small bandwidth.

    Args:
        vertices: (V, 3) where the optimisation starts, the world's frame, baselines.
        faces: (F, 3).
        directions: (V, 3) along which vertices move, any length.
        distances: (V,) from which they are seen.

    Returns:
        The surface, and (V,) for each of its vertices the index of the one given.
    """
    count = len(vertices)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ones = np.ones(len(edges))
    graph = sp.csr_array((ones, edges.T), shape=(count, count))
    # Bends couple the far corners of neighbouring triangles: two steps along edges.
    order = np.asarray(reverse_cuthill_mckee(sp.csr_matrix(graph + graph.T), symmetric_mode=True))
    position = np.empty(count, np.int64)
    position[order] = np.arange(count)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    mesh = TriangleMesh(vertices[order], unit[order], distances[order], position[faces])
    return mesh, order.astype(np.int64)

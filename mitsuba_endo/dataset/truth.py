"""Everything that is true of a sample, as images."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..capture.creases import with_creases
from ..decoding.grid_pattern import CodedGrid
from ..geometry.endoscope import Endoscope
from ..shapes.mesh import Mesh

if TYPE_CHECKING:
    from ..rendering.synthetic import Hits, MeshScene

MIXED = 0.25
"""Change of the projector coordinate from pixel to pixel, in grid periods, above which a pixel
counts as mixed: it sees both sides of a depth step, or more lines than it can resolve."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TruthMaps:
    """Images (H, W[, channels]) of one sample; missing = NaN, or -1 for nodes."""

    q: NDArray[np.float32]
    """(H, W, 2) projector coordinates, pattern pixels; also in shadow and outside the pattern."""
    phase: NDArray[np.float32]
    """(H, W, 2) phase in the grid's period along x and y, radians in [-pi, pi)."""
    node: NDArray[np.int16]
    """(H, W, 2) column and row of the nearest node of the grid; -1 outside the grid."""
    code: NDArray[np.int8]
    """(H, W) code of that node: -1, 0, 1; 0 outside the grid, too."""
    depth: NDArray[np.float32]
    """(H, W) z in the camera's frame, mm."""
    normals: NDArray[np.float32]
    """(H, W, 3) unit normals in the camera's frame, towards the camera; smooth but at creases."""
    visible: NDArray[np.bool_]
    """(H, W) the pattern lights it."""
    shadow: NDArray[np.bool_]
    """(H, W) within the pattern but not lit: occluded, or facing away from the projector."""
    camera: NDArray[np.bool_]
    """(H, W) the camera sees the surface."""
    mixed: NDArray[np.bool_]
    """(H, W) lit, and q jumps to a neighbour by more than a quarter of a period, or the
    neighbour is not lit: no decoder can be right there."""

    def correspondences(self) -> NDArray[np.float32]:
        """Return the map (H, W, 2) of an ideal decoder: q where lit, else NaN."""
        return np.where(self.visible[..., None], self.q, np.float32(np.nan))


def truth_maps(
    scene: "MeshScene",
    mesh: Mesh,
    endoscope: Endoscope,
    grid: CodedGrid,
    hits: "Hits | None" = None,
) -> TruthMaps:
    """Compute the truth of one view with one ray through every pixel's centre.

    ``hits`` are the places where these rays meet the mesh, if they are known already.
    """
    camera, world_from_camera = endoscope.camera, endoscope.world_from_camera
    shape = camera.height, camera.width
    rays = world_from_camera.rotate(camera.grid_rays.reshape(-1, 3))
    if hits is None:
        hits = scene.through_pixels(camera, world_from_camera)
    points = world_from_camera.inverse().apply(hits.points)
    q = endoscope.projector.project(endoscope.projector_from_camera.apply(points))
    q = np.where(hits.hit[:, None], q, np.nan)
    light = endoscope.world_from_projector.t
    size = np.array([grid.width, grid.height])
    with np.errstate(invalid="ignore"):
        inside = ((q >= -0.5) & (q <= size - 0.5)).all(1)
    lit = inside & _same_side(hits, rays, light) & scene.reaches(light, hits.points)
    truth = grid.truth(q)
    normals = world_from_camera.inverse().rotate(_normals(mesh, hits, rays))
    q_image, visible = q.reshape(*shape, 2), lit.reshape(shape)
    q_lit = np.where(visible[..., None], q_image, np.nan)
    return TruthMaps(
        q=q_image.astype(np.float32),
        phase=truth.phase.reshape(*shape, 2).astype(np.float32),
        node=truth.node.reshape(*shape, 2).astype(np.int16),
        code=truth.code.reshape(shape).astype(np.int8),
        depth=np.where(hits.hit, points[:, 2], np.nan).reshape(shape).astype(np.float32),
        normals=normals.reshape(*shape, 3).astype(np.float32),
        visible=visible,
        shadow=(inside & ~lit).reshape(shape),
        camera=hits.hit.reshape(shape),
        mixed=visible & (largest_step(q_lit) > MIXED * grid.period),
    )


def _same_side(hits: "Hits", rays: Array, light: Array) -> NDArray[np.bool_]:
    """Tell where the projector is on the side of the face that the camera sees."""
    to_camera = -np.einsum("ni,ni->n", hits.normals, rays)
    to_light = np.einsum("ni,ni->n", hits.normals, light - hits.points)
    with np.errstate(invalid="ignore"):
        return to_camera * to_light > 0


def _normals(mesh: Mesh, hits: "Hits", rays: Array) -> Array:
    """Return (N, 3) unit normals in the world, as the photograph is shaded; NaN without hit."""
    shaded = Mesh(*with_creases(mesh))
    corners = shaded.faces[hits.triangle]
    a, b, c = (shaded.vertices[corners[:, i]] for i in range(3))
    face, rest = hits.normals, hits.points - a
    square = np.einsum("ni,ni->n", face, face)
    v = np.einsum("ni,ni->n", np.cross(rest, c - a), face) / square
    w = np.einsum("ni,ni->n", np.cross(b - a, rest), face) / square
    # Weighted by the faces' angles, as Mitsuba does.
    smooth = np.asarray(_around(shaded, corners).to_trimesh().vertex_normals)
    na, nb, nc = (smooth[corners[:, i]] for i in range(3))
    normal = na + v[:, None] * (nb - na) + w[:, None] * (nc - na)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    towards = np.where(np.einsum("ni,ni->n", normal, rays) > 0, -1.0, 1.0)
    return np.where(hits.hit[:, None], normal * towards[:, None], np.nan)


def _around(mesh: Mesh, corners: NDArray[np.int64]) -> Mesh:
    """Return the mesh with only the faces at the vertices ``corners``: all their normals need."""
    wanted = np.zeros(len(mesh.vertices), bool)
    wanted[corners] = True
    return Mesh(mesh.vertices, mesh.faces[wanted[mesh.faces].any(1)])


def largest_step(q: Array) -> Array:
    """Return the largest change (H, W) to any of the four neighbours; infinite beside NaN."""
    step = np.zeros(q.shape[:2])
    across = np.nan_to_num(np.abs(np.diff(q, axis=1)).max(-1), nan=np.inf)
    down = np.nan_to_num(np.abs(np.diff(q, axis=0)).max(-1), nan=np.inf)
    step[:, 1:] = across
    step[:, :-1] = np.maximum(step[:, :-1], across)
    step[1:] = np.maximum(step[1:], down)
    step[:-1] = np.maximum(step[:-1], down)
    return step

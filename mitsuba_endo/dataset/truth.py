"""Everything that is true of a sample, as images."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture.creases import with_creases
from ..decode.grid_pattern import CodedGrid
from ..geometry.cameras import CameraModel
from ..geometry.laws import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..rendering.synthetic import Hits, MeshScene
from ..shapes.mesh import Mesh

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
    scene: MeshScene,
    mesh: Mesh,
    camera: CameraModel,
    world_from_camera: RigidTransform,
    projector: ProjectorModel,
    projector_from_camera: RigidTransform,
    grid: CodedGrid,
    hits: Hits | None = None,
) -> TruthMaps:
    """Compute the truth of one view with one ray through every pixel's centre.

    ``hits`` are the places where these rays meet the mesh, if they are known already.
    """
    shape = camera.height, camera.width
    ways = world_from_camera.rotate(camera.grid_rays.reshape(-1, 3))
    if hits is None:
        hits = scene.through_pixels(camera, world_from_camera)
    points = world_from_camera.inverse().apply(hits.points)
    q = np.where(hits.hit[:, None], projector.project(projector_from_camera.apply(points)), np.nan)
    light = (world_from_camera @ projector_from_camera.inverse()).t
    size = np.array([grid.width, grid.height])
    with np.errstate(invalid="ignore"):
        inside = ((q >= -0.5) & (q <= size - 0.5)).all(1)
    lit = inside & _same_side(hits, ways, light) & scene.reaches(light, hits.points)
    truth = grid.truth(q)
    normals = world_from_camera.inverse().rotate(_normals(mesh, hits, ways))
    q_image, visible = q.reshape(*shape, 2), lit.reshape(shape)
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
        mixed=visible & _jumps(np.where(visible[..., None], q_image, np.nan), grid.period),
    )


def _same_side(hits: Hits, ways: Array, light: Array) -> NDArray[np.bool_]:
    """Tell where the projector is on the side of the face that the camera sees."""
    to_camera = -np.einsum("ni,ni->n", hits.normals, ways)
    to_light = np.einsum("ni,ni->n", hits.normals, light - hits.points)
    with np.errstate(invalid="ignore"):
        return to_camera * to_light > 0


def _normals(mesh: Mesh, hits: Hits, ways: Array) -> Array:
    """Return (N, 3) unit normals in the world, as the photograph is shaded; NaN without hit."""
    shaded = Mesh(*with_creases(mesh))
    corners = shaded.faces[hits.triangle]
    a, b, c = (shaded.vertices[corners[:, i]] for i in range(3))
    face, rest = hits.normals, hits.points - a
    square = np.einsum("ni,ni->n", face, face)
    v = np.einsum("ni,ni->n", np.cross(rest, c - a), face) / square
    w = np.einsum("ni,ni->n", np.cross(b - a, rest), face) / square
    smooth = vertex_normals(_around(shaded, corners))
    na, nb, nc = (smooth[corners[:, i]] for i in range(3))
    normal = na + v[:, None] * (nb - na) + w[:, None] * (nc - na)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    towards = np.where(np.einsum("ni,ni->n", normal, ways) > 0, -1.0, 1.0)
    return np.where(hits.hit[:, None], normal * towards[:, None], np.nan)


def _around(mesh: Mesh, corners: NDArray[np.int64]) -> Mesh:
    """Return the mesh with only the faces at the vertices ``corners``: all their normals need."""
    wanted = np.zeros(len(mesh.vertices), bool)
    wanted[corners] = True
    return Mesh(mesh.vertices, mesh.faces[wanted[mesh.faces].any(1)])


def vertex_normals(mesh: Mesh) -> Array:
    """Return (V, 3) unit normals: the mean of the faces' ones, weighted by their angles there."""
    corners = mesh.vertices[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    sides /= np.linalg.norm(sides, axis=2, keepdims=True)
    face = np.cross(sides[:, 0], sides[:, 1])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    cosine = -np.einsum("fki,fki->fk", sides, np.roll(sides, 1, axis=1))
    weight = np.arccos(np.clip(cosine, -1, 1)).ravel()
    index = mesh.faces.ravel()
    total = np.stack([
        np.bincount(index, weight * np.repeat(face[:, i], 3), len(mesh.vertices)) for i in range(3)
    ], 1)  # fmt: skip
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1)


def _jumps(q: Array, period: float) -> NDArray[np.bool_]:
    """Tell where q (H, W, 2) differs much from a neighbour on the right, left, above or below."""
    mixed = np.zeros(q.shape[:2], bool)
    for axis in (0, 1):
        step = np.abs(np.diff(q, axis=axis)).max(-1)
        wide = ~(step <= MIXED * period)
        before, after = [slice(None)] * 2, [slice(None)] * 2
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        mixed[tuple(before)] |= wide
        mixed[tuple(after)] |= wide
    return mixed

"""Surfaces that the user gives: read, checked, scaled to mm and turned to face the camera."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from .. import backend
from ..capture.checks import check_winding
from ..errors import InputError
from ..records.surface import load_surface
from ..rendering.scene_surfaces import scene_mesh
from ..rendering.synthetic import MeshScene
from ..shapes.mesh import Mesh
from .scene_ranges import Scene

MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3}
"""Millimetres in each unit."""
SMALLEST, LARGEST = 5.0, 3000.0
"""Sizes of a believable surface (diagonal of its box), mm: others are mistaken units."""
PROBES, RAYS = 200, 32
"""Places on a surface and rays from each: 6,400 rays tell a share to half a percent."""
CLEAR = 0.05
"""Least difference between both sides' shares of rays that meet the surface again, for one side to
count as the inside."""

FAR = 100.0
"""Sizes of a surface from the origin, from which single precision rounds by 1e-5 of its size."""
OFF_WALL = 1e-4
"""Of the surface's size: where a ray starts, lest it meets the face that it starts on."""

Array = NDArray[np.float64]


def load_user_mesh(scene: Scene) -> Mesh:
    """Return the surface of a scene of kind ``file``, mm, faces towards the camera's side.

    Mitsuba is started, if no variant is active, to follow rays.

    Raises:
        InputError: no readable surface, no triangles, an unbelievable size, faces wound against
            each other, or no inside or outside to be told apart.
    """
    source = str(scene.file)
    raw = _read(Path(source))
    mesh = Mesh(raw.vertices * MM[scene.unit], raw.faces)
    mesh = _joined(_used(mesh))
    _check_size(mesh, source, scene.unit)
    mesh = near_origin(mesh)
    check_winding(mesh, source)
    if scene.side == "front":
        return mesh
    return _turned(mesh, scene.side, source)


def _read(path: Path) -> Mesh:
    if path.suffix.lower() == ".xml":
        return scene_mesh(path)
    surface = load_surface(path)
    return Mesh(surface.vertices, surface.faces)


def _used(mesh: Mesh) -> Mesh:
    """Leave out vertices that no triangle has: they may be anywhere."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(mesh.faces.shape))


def near_origin(mesh: Mesh) -> Mesh:
    """Return a mesh far from the origin, as surveys and scanners store it, about the origin.

    Rendering is in single precision. Cameras are placed on the surface, so nothing else moves.
    """
    middle, size = mesh.bounds.mean(0), float(np.linalg.norm(np.diff(mesh.bounds, axis=0)))
    if np.linalg.norm(middle) <= FAR * size:
        return mesh
    return Mesh(mesh.vertices - middle, mesh.faces, mesh.uv)


def _check_size(mesh: Mesh, source: str, unit: str) -> None:
    size = float(np.linalg.norm(np.diff(mesh.bounds, axis=0)))
    if SMALLEST <= size <= LARGEST:
        return
    in_metres = SMALLEST <= 1000 * size <= LARGEST
    raise InputError(
        f"the surface is {size:.3g} mm large" + (", as if in metres" if in_metres else ""),
        source,
        f"correct the scene's unit, which is {unit}" + ("; try unit: m" if in_metres else ""),
    )


def _joined(mesh: Mesh) -> Mesh:
    """Merge equal vertices, as STL files have them, and leave out faces without area."""
    merged = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    kept = merged.area_faces > 0
    return Mesh(np.array(merged.vertices, np.float64), np.array(merged.faces[kept], np.int64))


def _turned(mesh: Mesh, side: str, source: str) -> Mesh:
    """Return the mesh with its faces towards the wanted side, found by following rays.

    Rays that leave the inner side of a solid or a tube meet it again, those from the outer side
    mostly do not.
    """
    backend.ensure()
    front, back = _closedness(mesh)
    if abs(front - back) < CLEAR:
        raise InputError(
            "its two sides cannot be told apart as inside and outside",
            source,
            "set the scene's side to front and orient the faces to the camera",
        )
    towards_inside = front > back
    if towards_inside == (side == "inside"):
        return mesh
    return Mesh(mesh.vertices, mesh.faces[:, ::-1].copy(), mesh.uv)


def _closedness(mesh: Mesh) -> tuple[float, float]:
    """Return the shares of rays that meet the mesh again, from its faces' front and back."""
    rng = np.random.default_rng(0)
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    area = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(area), PROBES, p=area / area.sum())
    normal = normals[chosen] / area[chosen, None]
    centres = ((a + b + c) / 3)[chosen]
    scene = MeshScene(mesh.vertices, mesh.faces)
    step = OFF_WALL * float(np.linalg.norm(np.diff(mesh.bounds, axis=0)))
    rays = rng.standard_normal((PROBES, RAYS, 3))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    above = np.einsum("pri,pi->pr", rays, normal)
    rays = np.where(above[..., None] < 0, -rays, rays)
    return tuple(  # pyright: ignore[reportReturnType]
        float(scene.cast(_repeated(centres + sign * step * normal), sign * rays.reshape(-1, 3))
              .hit.mean())
        for sign in (1, -1)
    )  # fmt: skip


def _repeated(points: Array) -> Array:
    return np.repeat(points, RAYS, axis=0)


def note(mesh: Mesh) -> dict[str, Any]:
    """Return what the dataset's record says of a surface: its size and its flaws."""
    edges = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], -1).reshape(-1, 2), 1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    return {
        "triangles": len(mesh.faces),
        "size_mm": np.round(np.diff(mesh.bounds, axis=0)[0], 3).tolist(),
        "open_edges": int((counts == 1).sum()),
        "edges_of_three_or_more_faces": int((counts > 2).sum()),
    }

"""What the first camera sees of the measured surface."""

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..evaluate.depth import RayCaster, range_image
from ..geometry.cameras import CameraModel
from ..records.calibration import SurfaceEstimate

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SurfaceView:
    """Images of a surface in a camera, NaN where the camera does not see it."""

    points: Floats
    """(H, W, 3) seen points, camera frame, the surface's unit."""
    normals: Floats
    """(H, W, 3) smooth unit normals, towards the camera."""
    std: Floats | None
    """(H, W) standard deviation of the surface along the ray, the surface's unit."""
    modes: Floats | None = None
    """(H, W, K) the part of ``std`` that all points share, see :class:`SurfaceEstimate`."""

    @property
    def depth(self) -> Floats:
        """(H, W) z of the seen points."""
        return self.points[..., 2]


def view_surface(surface: SurfaceEstimate, camera: CameraModel) -> SurfaceView:
    """Cast every pixel's ray at a surface in the camera's frame."""
    rays = camera.grid_rays
    flat = rays.reshape(-1, 3)
    distance, triangle = RayCaster(surface.vertices, surface.faces).meet(np.zeros(3), flat)
    hit = np.isfinite(distance)
    points = np.full(flat.shape, np.nan)
    points[hit] = flat[hit] * distance[hit, None]
    corners = surface.faces[triangle[hit]]
    weights = _barycentric(points[hit], surface.vertices[corners])
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    normals = np.full(flat.shape, np.nan)
    normals[hit] = _towards_camera(
        np.einsum("nk,nkc->nc", weights, np.asarray(mesh.vertex_normals)[corners]), flat[hit]
    )
    std = None
    if surface.std is not None:
        std = np.full(len(flat), np.nan)
        std[hit] = np.sum(weights * surface.std[corners], -1)
        std = std.reshape(rays.shape[:2])
    modes = None
    if surface.modes is not None:
        modes = np.full((len(flat), surface.modes.shape[1]), np.nan)
        modes[hit] = np.einsum("nk,nkm->nm", weights, surface.modes[corners])
        modes = modes.reshape(*rays.shape[:2], -1)
    return SurfaceView(points.reshape(rays.shape), normals.reshape(rays.shape), std, modes)


def range_of(surface: SurfaceEstimate, camera: CameraModel) -> Floats:
    """Return the range (H, W) of a surface in the camera's frame along the camera's rays."""
    return range_image(RayCaster(surface.vertices, surface.faces), camera)


def _barycentric(points: Floats, corners: Floats) -> Floats:
    """Return the weights (N, 3) of points (N, 3) in the planes of triangles (N, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.sum(normal * normal, -1)
    w_b = np.sum(np.cross(points - a, c - a) * normal, -1) / squared
    w_c = np.sum(np.cross(b - a, points - a) * normal, -1) / squared
    return np.stack([1 - w_b - w_c, w_b, w_c], -1)


def _towards_camera(normals: Floats, rays: Floats) -> Floats:
    unit = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    return np.where(np.sum(unit * rays, -1, keepdims=True) > 0, -unit, unit)

"""From the optimum to images and the surface that people look at."""

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..records.calibration import FrameMaps, SurfaceEstimate
from .fit import Fit
from .linearise import FrameRenderer

USED_WEIGHT = 0.1
"""Robust weight above which a correspondence counts as used."""
_SUPPORT = 1.0
"""Sum of the robust weights around a vertex from which on it counts as seen."""


def support(fit: Fit, surface: int) -> NDArray[np.float64]:
    """Return the robust weight (V,) of the observations around every vertex of a surface."""
    total = np.zeros(fit.problem.surfaces[surface].lattice.size)
    for k, lin in enumerate(fit.optimum.evaluation.linearisations):
        if fit.problem.plan.surface_of(k) == surface:
            weight = np.repeat(fit.optimum.weights[k], 3)
            total += np.bincount(lin.triangles.ravel(), weight, len(total))
    return total


def surface_estimate(fit: Fit, surface: int, factor: float, inflation: float) -> SurfaceEstimate:
    """Return the seen part of a surface.

    Args:
        fit: the optimum.
        surface: its index.
        factor: solution's unit per baseline.
        inflation: multiplies the formal standard deviation.
    """
    lattice, rho = fit.problem.surfaces[surface].lattice, fit.optimum.state.rho[surface]
    seen = support(fit, surface) >= _SUPPORT
    faces = lattice.faces[seen[lattice.faces].all(1)]
    kept, flat = np.unique(faces, return_inverse=True)
    std = inflation * fit.uncertainty.rho_std[surface] / rho**2
    return SurfaceEstimate(
        factor * lattice.vertices(rho)[kept], flat.reshape(-1, 3), factor * std[kept]
    )


def frame_maps(fit: Fit, camera: CameraModel) -> tuple[list[FrameMaps], list[NDArray[np.float64]]]:
    """Render every frame at all pixels.

    Returns:
        The maps, and for each frame the range (H, W) along the unit camera rays in baselines,
        NaN where the surface was not seen.
    """
    rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
    finite = np.isfinite(rays).all(1)
    shape = (camera.height, camera.width)
    fit.problem.move_surfaces(fit.optimum.state)
    maps, ranges = [], []
    for k, map_ in enumerate(fit.maps):
        s = fit.problem.plan.surface_of(k)
        old = fit.problem.renderers[k]
        renderer = FrameRenderer(old.scene, rays[finite], fit.law, old.at_centre)
        q, distance, triangles, hit = renderer.render(fit.optimum.state, k, s)
        seen = hit & (support(fit, s)[triangles] >= _SUPPORT).all(1)
        rendered = np.full((len(rays), 2), np.nan, np.float32)
        rendered[finite] = np.where(seen, q, np.nan).T
        range_ = np.full(len(rays), np.nan)
        range_[finite] = np.where(seen, distance, np.nan)
        maps.append(FrameMaps(map_.name, map_.q, rendered.reshape(*shape, 2), _used(fit, k, shape)))
        ranges.append(range_.reshape(shape))
    return maps, ranges


def _used(fit: Fit, frame: int, shape: tuple[int, int]) -> NDArray[np.bool_]:
    used = np.zeros(shape, bool)
    x, y = fit.problem.frames[frame].pixels.T
    used[y, x] = fit.optimum.weights[frame] > USED_WEIGHT
    return used

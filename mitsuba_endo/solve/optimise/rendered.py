"""What an optimum looks like: its seen surface, and its frames at every pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ..cost.linearise import FrameRenderer
from .optimum import Optimum

USED_WEIGHT = 0.1
"""Robust weight above which a correspondence counts as used."""
_SUPPORT = 1.0
"""Sum of the robust weights around a vertex from which on it counts as seen."""
_STEEP = 4.0
"""Rise of the range over the cell's width, the tangent of 76 degrees, from which on a triangle
may be the bridge over a depth step."""
_AGREE = 0.5
"""Mean robust weight of the observations on a triangle below which they contradict it."""


def seen_faces(optimum: Optimum, surface: int) -> NDArray[np.bool_]:
    """Return which triangles (F,) of a surface were seen.

    All corners need support; a triangle that bridges a depth step, steep and with observations
    that contradict it, is none of the surface.
    """
    problem, at = optimum.objective.problem, optimum.evaluation
    lattice, rho = problem.surfaces[surface].lattice, optimum.state.rho[surface]
    corners = lattice.faces
    support = np.zeros(lattice.size)
    weight, count = np.zeros(len(corners)), np.zeros(len(corners))
    for k, (faces, hit) in enumerate(zip(at.faces, at.hits, strict=True)):
        if problem.plan.surface_of(k) == surface:
            support += optimum.support(k)
            weight += np.bincount(faces[hit], optimum.weights[k][hit], len(corners))
            count += np.bincount(faces[hit], minlength=len(corners))
    range_ = 1 / rho[corners]
    steep = np.ptp(range_, axis=1) > _STEEP * lattice.cell * range_.mean(1)
    bridges = steep & (weight < _AGREE * np.maximum(count, 1))
    return (support[corners] >= _SUPPORT).all(1) & ~bridges


@dataclass(frozen=True, eq=False)
class Rendering:
    """One frame rendered at every pixel of the camera."""

    q: NDArray[np.float32]
    """(H, W, 2) projector coordinates, pattern pixels, NaN where no seen surface is met."""
    range: NDArray[np.float64]
    """(H, W) range along the unit camera rays, working unit, NaN likewise."""
    used: NDArray[np.bool_]
    """(H, W) correspondences that the robust loss kept."""


def render_frames(optimum: Optimum, camera: CameraModel) -> list[Rendering]:
    """Render every frame of an optimum at all pixels."""
    problem, state = optimum.objective.problem, optimum.state
    problem.move_surfaces(state)
    rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
    finite = np.isfinite(rays).all(1)
    shape = (camera.height, camera.width)
    seen_of = [seen_faces(optimum, s) for s in range(problem.plan.surfaces)]
    out = []
    for k, old in enumerate(problem.renderers):
        s = problem.plan.surface_of(k)
        renderer = FrameRenderer(old.scene, rays[finite], problem.law, old.at_centre)
        coordinates, distance, faces, hit = renderer.render(state, k, s)
        seen = hit & seen_of[s][faces]
        q = np.full((len(rays), 2), np.nan, np.float32)
        q[finite] = np.where(seen, coordinates, np.nan).T
        range_ = np.full(len(rays), np.nan)
        range_[finite] = np.where(seen, distance, np.nan)
        used = np.zeros(shape, bool)
        x, y = problem.frames[k].pixels.T
        used[y, x] = optimum.weights[k] > USED_WEIGHT
        out.append(Rendering(q.reshape(*shape, 2), range_.reshape(shape), used))
    return out

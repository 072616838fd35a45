"""Rendering a result: its seen surface, and its frames at every pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from .result import USED_WEIGHT, OptimisationResult

_SUPPORT = 1.0
"""Sum of the robust weights around a vertex from which on it counts as seen."""
_AGREE = 0.5
"""Mean robust weight of the observations on a triangle below which they contradict it."""


def seen_faces(result: OptimisationResult, surface: int) -> NDArray[np.bool_]:
    """Return which triangles (F,) of a surface were seen.

    All corners need support; a triangle that bridges a depth step, steep and with observations
    that contradict it, is none of the surface.
    """
    problem = result.problem
    shape = problem.surfaces[surface]
    support = np.zeros(shape.size)
    weight, count = np.zeros(len(shape.faces)), np.zeros(len(shape.faces))
    for k, at in enumerate(result.evaluation.frames):
        if problem.layout.surface_of[k] == surface:
            support += result.support(k)
            hit_faces, w = at.faces[at.hits], result.weights[k][at.hits]
            weight += np.bincount(hit_faces, w, len(shape.faces))
            count += np.bincount(hit_faces, minlength=len(shape.faces))
    bridges = shape.bridges(result.state.surfaces[surface])
    bridges &= weight < _AGREE * np.maximum(count, 1)
    return (support[shape.faces] >= _SUPPORT).all(1) & ~bridges


@dataclass(frozen=True, eq=False)
class Rendering:
    """One frame rendered at every pixel of the camera."""

    q: NDArray[np.float32]
    """(H, W, 2) projector coordinates, pattern pixels, NaN where no seen surface is met."""
    range: NDArray[np.float64]
    """(H, W) range along the unit camera rays, baselines, NaN likewise."""
    used: NDArray[np.bool_]
    """(H, W) correspondences that the robust loss kept."""


def render_frames(result: OptimisationResult, camera: CameraModel) -> list[Rendering]:
    """Render every frame of a result at all pixels."""
    problem, state = result.problem, result.state
    problem.place(state)
    pixels = camera.pixel_grid().reshape(-1, 2)
    finite = np.isfinite(camera.grid_rays.reshape(-1, 3)).all(1)
    shape = (camera.height, camera.width)
    seen_of = [seen_faces(result, s) for s in range(problem.layout.surfaces)]
    out = []
    for k, term in enumerate(problem.frames):
        at = term.renderer.at_pixels(pixels[finite]).render(state)
        visible = at.hit & seen_of[term.surface][at.faces]
        q = np.full((len(pixels), 2), np.nan, np.float32)
        q[finite] = np.where(visible, at.q, np.nan).T
        range_ = np.full(len(pixels), np.nan)
        range_[finite] = np.where(visible, at.distance, np.nan)
        used = np.zeros(shape, bool)
        x, y = term.observed.pixels.T
        used[y, x] = result.weights[k] > USED_WEIGHT
        out.append(Rendering(q.reshape(*shape, 2), range_.reshape(shape), used))
    return out

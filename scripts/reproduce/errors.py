"""The experiments' one way to compare a surface with the truth: the package's."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.alignment import align_robustly
from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.evaluate.shape import Alignment, ShapeErrors, compare_shape
from mitsuba_endo.records.calibration import SurfaceEstimate

from .capture import Truth

Floats = NDArray[np.float64]


def shape_errors(surface: SurfaceEstimate, truth: Truth, alignment: Alignment) -> ShapeErrors:
    """Compare a surface in the first camera's frame with the truth.

    Raises:
        RuntimeError: the surfaces have nothing in common.
    """
    found = compare_shape(surface, truth.surface, truth.camera, truth.lighting, alignment)
    if isinstance(found, str):
        raise RuntimeError(found)
    return found


@dataclass(frozen=True, eq=False)
class Seen:
    """A surface, aligned, along the first camera's rays."""

    points: Floats
    """(H, W, 3) mm, NaN = not covered."""
    distances: Floats
    """(H, W) to the nearest point of the true surface, mm, NaN likewise."""


def seen(surface: SurfaceEstimate, truth: Truth, alignment: Literal["rigid", "similarity"]) -> Seen:
    """Return the points of a surface on the first camera's rays and their errors."""
    camera = truth.camera
    rays = camera.grid_rays
    true = range_image(RayCaster(truth.mesh.vertices, truth.mesh.faces), camera)
    found = range_image(RayCaster(surface.vertices, surface.faces), camera)
    both = np.isfinite(true) & np.isfinite(found)
    fit = align_robustly(
        rays[both] * found[both, None], rays[both] * true[both, None],
        scale=alignment == "similarity", rotation=True,
    )  # fmt: skip
    moved = RayCaster(fit.apply(surface.vertices), surface.faces)
    points = rays * range_image(moved, camera)[..., None]
    there = np.isfinite(points[..., 0]) & np.isfinite(true)
    distances = np.full(there.shape, np.nan)
    distances[there] = distance_to_mesh(points[there], truth.mesh.vertices, truth.mesh.faces)
    return Seen(points, distances)


def rms_where_all_see(all_seen: list[Seen]) -> list[float]:
    """Return the RMS error of each surface over the rays on which all have a point."""
    common = np.logical_and.reduce([np.isfinite(s.distances) for s in all_seen])
    return [float(np.sqrt(np.mean(s.distances[common] ** 2))) for s in all_seen]

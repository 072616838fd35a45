"""From a fit to the maps and the surface that are saved."""

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import FrameMaps, SurfaceEstimate
from ..inference.covariance import shared_modes
from ..inference.fit import Fit
from ..minimisers.render_result import Rendering, seen_faces


def surface_estimate(fit: Fit, surface: int, factor: float, inflation: float) -> SurfaceEstimate:
    """Return the seen part of a surface.

    Args:
        fit: the optimum.
        surface: its index.
        factor: solution's unit per baseline.
        inflation: multiplies the formal standard deviation.
    """
    shape, values = fit.problem.surfaces[surface], fit.estimate.surfaces[surface]
    faces = shape.faces[seen_faces(fit.reported, surface)]
    kept, flat = np.unique(faces, return_inverse=True)
    moved = factor * shape.slopes(values)[kept]
    std, modes = _with_nuisance(fit, surface, inflation)
    return SurfaceEstimate(
        factor * shape.vertices(values)[kept], flat.reshape(-1, 3),
        moved * std[kept], moved[:, None] * modes[kept],
    )  # fmt: skip


def _with_nuisance(
    fit: Fit, surface: int, inflation: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return deviations (V,) and modes (V, K) of a surface's values, errors of what was given
    included.
    """
    std = inflation * fit.uncertainty.surface_std[surface]
    modes = inflation * fit.uncertainty.surface_modes[surface]
    if fit.model is None or (doubt := fit.model.nuisance) is None:
        return std, modes
    further = np.column_stack([doubt.surface_roots[surface], fit.model.surface_error(surface)])
    total = np.sqrt(std**2 + (further**2).sum(1))
    return total, shared_modes(np.concatenate([modes, further], 1))


def frame_maps(fit: Fit, renderings: list[Rendering]) -> list[FrameMaps]:
    """Put observed and rendered maps side by side."""
    return [FrameMaps(m.name, m.q, r.q, r.used) for m, r in zip(fit.maps, renderings, strict=True)]

"""From a fit to the maps and the surface that are saved."""

import numpy as np

from ...records.calibration import FrameMaps, SurfaceEstimate
from ..fit import Fit
from ..optimise.rendered import Rendering, seen_faces


def surface_estimate(fit: Fit, surface: int, factor: float, inflation: float) -> SurfaceEstimate:
    """Return the seen part of a surface.

    Args:
        fit: the optimum.
        surface: its index.
        factor: solution's unit per baseline.
        inflation: multiplies the formal standard deviation.
    """
    lattice, rho = fit.problem.surfaces[surface].lattice, fit.state.rho[surface]
    faces = lattice.faces[seen_faces(fit.reported, surface)]
    kept, flat = np.unique(faces, return_inverse=True)
    from_rho = factor * inflation / rho[kept] ** 2  # standard deviations: the sign is free
    return SurfaceEstimate(
        factor * lattice.vertices(rho)[kept], flat.reshape(-1, 3),
        from_rho * fit.uncertainty.rho_std[surface][kept],
        from_rho[:, None] * fit.uncertainty.rho_modes[surface][kept],
    )  # fmt: skip


def frame_maps(fit: Fit, renderings: list[Rendering]) -> list[FrameMaps]:
    """Put observed and rendered maps side by side."""
    return [FrameMaps(m.name, m.q, r.q, r.used) for m, r in zip(fit.maps, renderings, strict=True)]

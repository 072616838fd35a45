"""From a fit to the maps and the surface that are saved."""

import numpy as np

from ...records.calibration import FrameMaps, SurfaceEstimate
from ..inference.fit import Fit
from ..minimisers.rendered import Rendering, seen_faces


def surface_estimate(fit: Fit, surface: int, factor: float, inflation: float) -> SurfaceEstimate:
    """Return the seen part of a surface.

    Args:
        fit: the optimum.
        surface: its index.
        factor: solution's unit per baseline.
        inflation: multiplies the formal standard deviation.
    """
    shape, values = fit.problem.surfaces[surface], fit.state.surfaces[surface]
    faces = shape.faces[seen_faces(fit.reported, surface)]
    kept, flat = np.unique(faces, return_inverse=True)
    moved = factor * inflation * shape.slopes(values)[kept]
    return SurfaceEstimate(
        factor * shape.vertices(values)[kept], flat.reshape(-1, 3),
        moved * fit.uncertainty.surface_std[surface][kept],
        moved[:, None] * fit.uncertainty.surface_modes[surface][kept],
    )  # fmt: skip


def frame_maps(fit: Fit, renderings: list[Rendering]) -> list[FrameMaps]:
    """Put observed and rendered maps side by side."""
    return [FrameMaps(m.name, m.q, r.q, r.used) for m, r in zip(fit.maps, renderings, strict=True)]

"""How long the edges of a mesh may be: as finely as the surface bends, no finer than noise allows.

What frames see within a triangle fixes it to sigma_n / h, where sigma_n is the deviation of the
mean depth over a unit of area and h the edge. A flat triangle misses a surface of curvature kappa
by up to the sagitta kappa h^2 / 8. Where that is a fixed share of the noise, h^3 is proportional
to sigma_n / kappa: finer edges would only follow the noise, coarser ones cut folds off.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...fusion.curvature import averaging, curvatures
from ...fusion.fuse import FusedMesh
from ..costs.noise_scale import robust_noise
from ..inference.fit import FrameSolution

Floats = NDArray[np.float64]

_SAGITTA = 1 / 8
"""Largest share of the noise sigma_n / h that the sagitta may reach. In a folded lumen a fifth is
seen in the poses, since chords err alike over many pixels: 95 % intervals held the truth in 88 to
94 % of their components over five draws of the lumen study, with an eighth in 94 to 100 %."""
_FINEST, _COARSEST = 0.5, 2.5
"""Of edges, in spacings of a single frame's lattice there: several frames see more than one, but
not more than their pixels; and steps from one size to the next stay small."""
_ROUNDS = 8
"""Of averaging before curvature is taken, on a mesh with a third of a spacing between vertices:
over one spacing, which is what a frame alone resolves."""
_EVEN = 4
"""Of averaging of the lengths."""


def edge_lengths(
    fine: FusedMesh, frames: Sequence[FrameSolution], distances: Floats, disparity: float
) -> Floats:
    """Return the length (V,) that edges shall have about each vertex, baselines.

    Args:
        fine: the surface, finer than any edge that is wanted.
        frames: solved alone, that it is fused from.
        distances: (V,) of the nearest camera, baselines.
        disparity: focal length times baseline, pattern pixels times baselines.
    """
    cell = float(np.median([f.cell for f in frames]))
    in_cell = float(np.median([f.observations.count / len(f.points) for f in frames]))
    sigma = float(np.median([robust_noise(f.squared) for f in frames]))
    spacing = cell * distances
    density = in_cell * np.maximum(fine.frames, 1) / spacing**2  # observations per area
    of_area = sigma * distances**2 / disparity / np.sqrt(density)
    bent = curvatures(fine.vertices, fine.faces, fine.normals, _ROUNDS)
    edge = np.cbrt(8 * _SAGITTA * of_area / np.maximum(bent, 1e-300))
    edge = np.clip(edge, _FINEST * spacing, _COARSEST * spacing)
    mean = averaging(fine.faces, len(edge))
    for _ in range(_EVEN):
        edge = mean @ edge
    return edge

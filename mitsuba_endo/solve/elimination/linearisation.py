"""First-order model of the residuals of pixels, each of which sees one triangle."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..surfaces.surface import Surface

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """C components for each of N pixels of one frame."""

    values: Floats
    """(C, N) what is predicted, e.g. rendered coordinates, pattern pixels."""
    hit: NDArray[np.bool_]
    """(N,) pixels whose ray meets the surface in front of the projector."""
    surface: Surface
    faces: NDArray[np.int64]
    """(N,) triangle that the pixel sees, any where none is hit."""
    J_surface: Floats
    """(C, 3, N) derivatives with respect to the values of the triangle's vertices."""
    J_local: Floats
    """(C, L, N) derivatives with respect to the frame's active blocks, in the layout's order."""

    def whitened(self, W: Floats | None) -> "Linearisation":
        """Return the model whose derivatives are multiplied by W: (N,), (C, C, N) or None."""
        if W is None:
            return self
        return replace(self, J_surface=whiten(self.J_surface, W), J_local=whiten(self.J_local, W))

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """(N, 3) vertices that the pixel's hit point depends on."""
        return self.surface.faces[self.faces]


def whiten(values: Floats, W: Floats) -> Floats:
    """Return W values for values (C, ..., N) and a factor (N,) or a matrix (C, C, N) a pixel."""
    if W.ndim == 1:
        return values * W
    return np.einsum("abn,b...n->a...n", W, values)

"""How a surface depends on the global unknowns, frame by frame.

Every frame couples the vertices that it sees to a few unknowns: its poses and what all frames
share. Written out, the matrix would grow with the square of the number of frames.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CouplingPart:
    """What one frame adds."""

    vertices: NDArray[np.intp]
    """(n,) in rising order."""
    columns: NDArray[np.intp]
    """(c,) global unknowns."""
    values: Floats
    """(n, c)"""


@dataclass(frozen=True, eq=False)
class Coupling:
    """The matrix B (V, G) as a sum of small dense ones."""

    shape: tuple[int, int]
    parts: list[CouplingPart] = field(default_factory=list)

    def add(self, products: Floats, T: Floats) -> None:
        """Add ``products @ T`` of a frame's (V, L) products and its tangent map T (L, G)."""
        vertices = np.flatnonzero(products.any(1))
        columns = np.flatnonzero(T.any(0))
        if len(vertices) and len(columns):
            values = products[vertices] @ T[:, columns]
            self.parts.append(CouplingPart(vertices, columns, values))

    def rows(self, wanted: slice) -> Floats:
        """Return the (rows, G) of a range of vertices."""
        out = np.zeros((wanted.stop - wanted.start, self.shape[1]))
        for part in self.parts:
            first, last = np.searchsorted(part.vertices, [wanted.start, wanted.stop])
            at = np.ix_(part.vertices[first:last] - wanted.start, part.columns)
            out[at] += part.values[first:last]
        return out

    def __matmul__(self, right: Floats) -> Floats:
        """Return B x for x (G,) or (G, n)."""
        out = np.zeros((self.shape[0], *right.shape[1:]))
        for part in self.parts:
            out[part.vertices] += part.values @ right[part.columns]
        return out

"""What a surface is to the solver: triangles over vertices that slide along fixed lines.

One number a vertex says where it is on its line, X_i(s_i). Everything that knows what these numbers
mean is in the implementations; the normal equations, the smoothness and the renderer do not.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FacePattern:
    """Sparse (V, V) matrix that couples the vertices of every face."""

    indices: NDArray[np.int32]
    """Columns, as in ``csr_array``."""
    indptr: NDArray[np.int32]
    positions: NDArray[np.int64]
    """(F, 3, 3) place in the matrix's data of each pair of a face's vertices."""


@dataclass(frozen=True, eq=False)
class Bending:
    """Second differences of a surface, affine in its values: c = operator s + offset."""

    operator: sp.csr_array
    """(M, V), pattern pixels of disparity per unit of value."""
    offset: Floats | float = 0.0
    """(M,) pattern pixels, of s = 0."""


class Surface(ABC):
    """A triangulated surface with one unknown a vertex."""

    kind: ClassVar[str]
    """Name in files."""
    faces: NDArray[np.int64]
    """(F, 3) vertex indices."""

    @abstractmethod
    def record(self) -> dict[str, NDArray]:
        """Return the arrays that the surface is made of, for files."""

    @classmethod
    @abstractmethod
    def from_record(cls, arrays: Mapping[str, NDArray]) -> "Surface":
        """Return the surface of :meth:`record`."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of vertices V."""

    @abstractmethod
    def vertices(self, values: Floats) -> Floats:
        """Return the (V, 3) positions for values (V,), in the world's frame."""

    @abstractmethod
    def slopes(self, values: Floats) -> Floats:
        """Return how far (V,) a vertex moves along its line per unit of its value."""

    @abstractmethod
    def retract(self, values: Floats, step: Floats) -> Floats:
        """Return the values after a step (V,), kept where they have a meaning."""

    @abstractmethod
    def corners(self, vertex: Any, value: Any, active: Any) -> Any:
        """Return positions of vertices on Dr.Jit arrays.

        Args:
            vertex: indices.
            value: their values, differentiable.
            active: mask; elsewhere the result has no meaning.
        """

    @abstractmethod
    def bending(self, disparity: float) -> Bending:
        """Return the second differences that the smoothness prior acts on.

        Args:
            disparity: focal length times baseline, which makes pattern pixels of inverse range.
        """

    @abstractmethod
    def bridges(self, values: Floats) -> NDArray[np.bool_]:
        """Return which faces (F,) are so steep that they may bridge a depth step."""

    @abstractmethod
    def coarsened(self, room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return about ``room`` of the vertices (K,) and triangles (F, 3) over those."""

    def is_centre(self, point: Floats) -> bool:
        """Tell whether rays from a point (3,) never change triangle, whatever the values."""
        return False

    @cached_property
    def bandwidth(self) -> int:
        """Largest difference of indices that faces and smoothness couple."""
        operator = self.bending(1.0).operator.tocsr()
        ends = operator.indptr
        filled = ends[1:] > ends[:-1]
        low = np.minimum.reduceat(operator.indices, ends[:-1][filled]) if filled.any() else 0
        high = np.maximum.reduceat(operator.indices, ends[:-1][filled]) if filled.any() else 0
        return int(max(np.max(high - low), np.ptp(self.faces, axis=1).max(initial=1)))

    @cached_property
    def face_pattern(self) -> FacePattern:
        """Which entries of a normal matrix the observations fill."""
        rows = np.broadcast_to(self.faces[:, :, None], (len(self.faces), 3, 3))
        columns = np.broadcast_to(self.faces[:, None, :], rows.shape)
        key, positions = np.unique(rows * self.size + columns, return_inverse=True)
        row, column = np.divmod(key, self.size)
        counts = np.bincount(row, minlength=self.size)
        indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        return FacePattern(column.astype(np.int32), indptr, positions.reshape(rows.shape))

    def typical_range(self, values: Floats) -> float:
        """Return the median distance of the vertices from the world's origin."""
        return float(np.median(np.linalg.norm(self.vertices(values), axis=1)))

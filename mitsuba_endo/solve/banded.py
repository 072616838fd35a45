"""Banded Cholesky factorisation and the part of the inverse that its band holds.

The surface's lattice is numbered along its short side, so that its normal matrix is banded and
LAPACK factorises it several times faster than a general sparse Cholesky does.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """L L^T = A for a symmetric positive definite banded matrix."""

    factor: NDArray[np.float64]
    """(bandwidth + 1, V) lower form of LAPACK."""

    @classmethod
    def of(cls, matrix: sp.spmatrix | sp.sparray, bandwidth: int) -> "BandedCholesky":
        """Factorise a symmetric matrix of which the lower triangle is read.

        Raises:
            numpy.linalg.LinAlgError: it is not positive definite.
        """
        coo = sp.coo_array(matrix)
        size, _ = matrix.shape
        row, col = coo.coords
        lower = row >= col
        band = np.zeros((bandwidth + 1, size))
        band[row[lower] - col[lower], col[lower]] = coo.data[lower]
        return cls(scipy.linalg.cholesky_banded(band, lower=True, check_finite=False))

    def solve(self, rhs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A x = rhs for (V,) or (V, n) right-hand sides."""
        return scipy.linalg.cho_solve_banded((self.factor, True), rhs, check_finite=False)

    def inverse(self) -> "BandedInverse":
        """Return the part of the inverse that lies within the band.

        In blocks as wide as the band L is bidiagonal; with L_ii on and M_i below the diagonal,
        from the end upwards (Takahashi's recursion in blocks):
        Z_ii = (L_ii L_ii^T)^-1 + G^T Z_(i+1)(i+1) G, Z_(i+1)i = -Z_(i+1)(i+1) G, G = M_i L_ii^-1.
        """
        n, width = self.factor.shape[1], max(self.factor.shape[0] - 1, 1)
        ranges = [slice(i, min(i + width, n)) for i in range(0, n, width)]
        diagonal: list[NDArray] = [np.empty(0)] * len(ranges)
        below: list[NDArray] = [np.empty(0)] * (len(ranges) - 1)
        for i in reversed(range(len(ranges))):
            L = self._dense(ranges[i], ranges[i])
            inverse = scipy.linalg.solve_triangular(L, np.eye(len(L)), lower=True)
            diagonal[i] = inverse.T @ inverse
            if i + 1 < len(ranges):
                G = self._dense(ranges[i + 1], ranges[i]) @ inverse
                below[i] = -diagonal[i + 1] @ G
                diagonal[i] -= G.T @ below[i]
        return BandedInverse(width, diagonal, below)

    def _dense(self, rows: slice, cols: slice) -> NDArray[np.float64]:
        """Return a block of the factor as a dense matrix."""
        offset = np.arange(rows.start, rows.stop)[:, None] - np.arange(cols.start, cols.stop)
        inside = (offset >= 0) & (offset < self.factor.shape[0])
        columns = np.broadcast_to(np.arange(cols.start, cols.stop), offset.shape)
        return np.where(inside, self.factor[np.where(inside, offset, 0), columns], 0.0)


@dataclass(frozen=True, eq=False)
class BandedInverse:
    """Entries of an inverse within the band of the matrix."""

    width: int
    """Size of the blocks; the last one may be smaller."""
    diagonal: list[NDArray[np.float64]]
    below: list[NDArray[np.float64]]

    def entries(self, row: NDArray[np.integer], col: NDArray[np.integer]) -> NDArray[np.float64]:
        """Return entries (row, col), each pair at most the bandwidth apart."""
        row, col = np.maximum(row, col), np.minimum(row, col)
        out = np.empty(len(row))
        order = np.argsort(col // self.width, kind="stable")
        ends = np.searchsorted(col[order] // self.width, np.arange(len(self.diagonal) + 1))
        for i, block in enumerate(self.diagonal):
            part = order[ends[i] : ends[i + 1]]
            r, c = row[part] - i * self.width, col[part] - i * self.width
            same = r < len(block)
            out[part[same]] = block[r[same], c[same]]
            if not same.all():
                out[part[~same]] = self.below[i][r[~same] - len(block), c[~same]]
        return out

"""Banded Cholesky factorisation, block by block.

The surface's lattice is numbered along its short side, so that its normal matrix is banded and
LAPACK factorises it several times faster than a general sparse Cholesky does. In blocks as wide as
the band the factor L is bidiagonal; triangular solves of whole blocks run six times faster than
LAPACK's, which takes one right-hand side after the other, and hold two blocks at a time.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BandedCholesky:
    """L L^T = A for a symmetric positive definite banded matrix."""

    factor: Floats
    """(bandwidth + 1, V) lower form of LAPACK, in Fortran order."""

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
        band = np.zeros((bandwidth + 1, size), order="F")
        band[row[lower] - col[lower], col[lower]] = coo.data[lower]
        return cls(
            scipy.linalg.cholesky_banded(band, overwrite_ab=True, lower=True, check_finite=False)
        )

    @property
    def blocks(self) -> list[slice]:
        """Ranges of vertices, as wide as the band but for the last one."""
        n, width = self.factor.shape[1], self._width
        return [slice(i, min(i + width, n)) for i in range(0, n, width)]

    def forward(self, rhs: Iterable[Floats]) -> Iterator[Floats]:
        """Yield the blocks of L^-1 rhs for the :attr:`blocks` of rhs, (rows, n) each."""
        before: Floats | None = None
        for i, part in enumerate(rhs):
            rest = part if before is None else part - self._below(i - 1) @ before
            before = self._solve_diagonal(i, rest)
            yield before

    def solve(self, rhs: Floats) -> Floats:
        """Solve A x = rhs for (V,) or (V, n) right-hand sides."""
        if rhs.ndim == 1:
            return scipy.linalg.cho_solve_banded((self.factor, True), rhs, check_finite=False)
        x = np.empty_like(rhs)
        for rows, part in zip(
            self.blocks, self.forward(rhs[rows] for rows in self.blocks), strict=True
        ):
            x[rows] = part
        after = None
        for i, rows in reversed(list(enumerate(self.blocks))):
            rest = x[rows] if after is None else x[rows] - self._below(i).T @ after
            after = self._solve_diagonal(i, rest, transposed=True)
            x[rows] = after
        return x

    def inverse_entries(self, row: NDArray[np.integer], col: NDArray[np.integer]) -> Floats:
        """Return entries (row, col) of the inverse, each pair at most the bandwidth apart.

        With L_ii on and M_i below the diagonal, from the end upwards (Takahashi's recursion in
        blocks): Z_ii = (L_ii L_ii^T)^-1 + G^T Z_(i+1)(i+1) G, Z_(i+1)i = -Z_(i+1)(i+1) G,
        G = M_i L_ii^-1.
        """
        row, col = np.maximum(row, col), np.minimum(row, col)
        out = np.empty(len(row))
        order = np.argsort(col // self._width, kind="stable")
        blocks = self.blocks
        ends = np.searchsorted(col[order] // self._width, np.arange(len(blocks) + 1))
        Z_after: Floats | None = None
        for i, rows in reversed(list(enumerate(blocks))):
            L = self._diagonal(i)
            inverse = scipy.linalg.solve_triangular(L, np.eye(len(L)), lower=True)
            Z = columns = inverse.T @ inverse
            if Z_after is not None:
                G = self._below(i) @ inverse
                below = -Z_after @ G
                Z = Z - G.T @ below
                columns = np.concatenate([Z, below])
            part = order[ends[i] : ends[i + 1]]
            out[part] = columns[row[part] - rows.start, col[part] - rows.start]
            Z_after = Z
        return out

    @property
    def _width(self) -> int:
        return max(len(self.factor) - 1, 1)

    def _solve_diagonal(self, i: int, rhs: Floats, *, transposed: bool = False) -> Floats:
        """Solve L_ii x = rhs, or with its transpose."""
        return scipy.linalg.solve_triangular(
            self._diagonal(i), rhs, lower=True, trans=int(transposed), check_finite=False
        )

    def _diagonal(self, i: int) -> Floats:
        """Return block L_ii; what stands above its diagonal has no meaning."""
        rows = self.blocks[i]
        return self._view(rows, rows)

    def _below(self, i: int) -> Floats:
        """Return the block below L_ii, which is upper triangular."""
        blocks = self.blocks
        return np.triu(self._view(blocks[i + 1], blocks[i]), self._width - len(self.factor) + 1)

    def _view(self, rows: slice, cols: slice) -> Floats:
        """Return a block of L without a copy: its entry (r, c) is number r + c bandwidth."""
        bandwidth = len(self.factor) - 1
        flat = self.factor.T.reshape(-1)[rows.start + cols.start * bandwidth :]
        shape = (rows.stop - rows.start, cols.stop - cols.start)
        size = flat.itemsize
        return as_strided(flat, shape, (size, size * bandwidth), writeable=False)

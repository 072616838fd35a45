"""Banded Cholesky against dense linear algebra."""

import numpy as np
import pytest
import scipy.sparse as sp

from mitsuba_endo.solve.elimination.banded_cholesky import BandedCholesky


def banded(n: int, width: int, seed: int = 0) -> np.ndarray:
    """A random symmetric positive definite matrix with a full band."""
    L = np.tril(np.triu(np.random.default_rng(seed).normal(size=(n, n)), -width))
    return L @ L.T + np.eye(n)


# Sizes of which the blocks, as wide as the band, divide evenly, unevenly or not at all.
@pytest.mark.parametrize(("n", "width"), [(40, 8), (53, 7), (50, 7), (5, 9), (12, 1), (1, 1)])
class TestBanded:
    def test_solves(self, n: int, width: int):
        """Oracle: numpy.linalg.solve, one and several right-hand sides."""
        A = banded(n, min(width, n - 1))
        factor = BandedCholesky.of(sp.csr_array(A), width)
        rhs = np.random.default_rng(1).normal(size=(n, 3))
        np.testing.assert_allclose(factor.solve(rhs), np.linalg.solve(A, rhs), rtol=1e-8)
        np.testing.assert_allclose(factor.solve(rhs[:, 0]), np.linalg.solve(A, rhs[:, 0]), 1e-8)

    def test_inverts_within_the_band(self, n: int, width: int):
        """Oracle: numpy.linalg.inv, at every entry of the band in random order."""
        A = banded(n, min(width, n - 1))
        row, col = np.nonzero(np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= width)
        order = np.random.default_rng(2).permutation(len(row))
        found = BandedCholesky.of(sp.csr_array(A), width).inverse_entries(row[order], col[order])
        expected = np.linalg.inv(A)[row[order], col[order]]
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)


def test_refuses_a_matrix_that_is_not_positive_definite():
    """Oracle: one negative eigenvalue."""
    A = banded(20, 3) - 1.5 * np.linalg.eigvalsh(banded(20, 3))[0] * np.eye(20)
    with pytest.raises(np.linalg.LinAlgError):
        BandedCholesky.of(sp.csr_array(A), 3)

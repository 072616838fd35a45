"""Elimination of the surfaces from the normal equations: the Schur complement, and a step from it.

With surface blocks A_s, their coupling B_s to the global unknowns and the global block D:
S = D - sum_s B_s^T A_s^-1 B_s, S dx = reduced gradient, then the surfaces follow by
back-substitution. On the method's page D is G.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .banded_cholesky import BandedCholesky
from .coupling import Coupling

_RANK = 1e-12
"""Eigenvalue over the largest, the diagonal scaled to one, of a direction that nothing tells."""


@dataclass(eq=False)
class SurfaceBlock:
    """Part of the normal equations that belongs to one surface."""

    A: sp.csr_array
    """(V, V) Hessian of data and prior."""
    B: Coupling
    """(V, G) coupling to the global unknowns."""
    g: NDArray[np.float64]
    """(V,) gradient."""
    bandwidth: int

    def damped(self, mu: float) -> BandedCholesky:
        """Factorise A + mu diag(A)."""
        diagonal = self.A.diagonal()
        # A vertex without data or neighbours would make A singular.
        floor = 1e-12 * diagonal.max(initial=1.0)
        return BandedCholesky.of(
            self.A + sp.diags_array(mu * diagonal + floor, format="csr"), self.bandwidth
        )

    def eliminated(self, factor: BandedCholesky) -> NDArray[np.float64]:
        """Return [B, g]^T A^-1 [B, g], (G + 1, G + 1), from the factor of A.

        With Y = L^-1 [B, g] it is the sum of Y_i^T Y_i over blocks of rows, of which two are held
        at a time.
        """
        total = np.zeros((self.B.shape[1] + 1,) * 2)
        rhs = (np.column_stack([self.B.rows(i), self.g[i]]) for i in factor.blocks)
        for Y in factor.forward(rhs):
            total += Y.T @ Y
        return total


@dataclass(frozen=True, eq=False)
class Step:
    """A step that lowers the cost to first order."""

    surfaces: list[NDArray[np.float64]]
    """(V,) of every surface's values."""
    unknowns: NDArray[np.float64]
    """(G,) of the global unknowns."""
    schur: NDArray[np.float64]
    """(G, G) Schur complement, without damping of the global unknowns."""


@dataclass(frozen=True, eq=False)
class Reduced:
    """The normal equations after elimination of the surfaces."""

    S: NDArray[np.float64]
    """(G, G) Schur complement."""
    g: NDArray[np.float64]
    """(G,) reduced gradient."""
    factors: list[BandedCholesky]
    """Of every surface's A."""


def eliminate(
    surfaces: Sequence[SurfaceBlock], D: NDArray[np.float64], g: NDArray[np.float64], mu: float
) -> Reduced:
    """Eliminate the surfaces.

    Args:
        surfaces: blocks of the surfaces.
        D: (G, G) block of the global unknowns.
        g: (G,) their gradient.
        mu: damping of the surfaces, in their diagonals.
    """
    S, g = D.copy(), g.copy()
    factors = [block.damped(mu) for block in surfaces]
    for block, factor in zip(surfaces, factors, strict=True):
        total = block.eliminated(factor)
        S -= total[:-1, :-1]
        g -= total[:-1, -1]
    return Reduced((S + S.T) / 2, g, factors)


def solve_step(
    surfaces: Sequence[SurfaceBlock], D: NDArray[np.float64], reduced: Reduced, mu: float
) -> Step:
    """Return the step of all unknowns under damping ``mu``.

    Raises:
        numpy.linalg.LinAlgError: the damped system is not positive definite.
    """
    step = -solve_symmetric(reduced.S + mu * np.diag(np.diag(D)), reduced.g)
    moved = [
        -factor.solve(block.g + block.B @ step)
        for factor, block in zip(reduced.factors, surfaces, strict=True)
    ]
    return Step(moved, step, reduced.S)


def solve_symmetric(S: NDArray[np.float64], g: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve S x = g after scaling the diagonal to one; directions without information stay put."""
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    values, vectors = np.linalg.eigh(S * np.outer(scale, scale))
    if len(values) and values[-1] <= 0:
        raise np.linalg.LinAlgError("no information")
    keep = values > _RANK * values.max(initial=0.0)
    inverse = np.where(keep, 1 / np.where(keep, values, 1.0), 0.0)
    return scale * (vectors @ (inverse * (vectors.T @ (scale * g))))

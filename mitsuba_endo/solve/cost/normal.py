"""Normal equations, sparse over surface vertices and dense over the global unknowns.

With surface blocks A_s, their coupling B_s to the global unknowns and the global block D, the
surfaces are eliminated: S = D - sum_s B_s^T A_s^-1 B_s (Schur complement), S dx = reduced
gradient, then the surfaces follow by back-substitution.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .banded import BandedCholesky
from .coupling import Coupling
from .linearise import Linearisation


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


@dataclass(eq=False)
class NormalEquations:
    """Gauss-Newton approximation of the robust cost around a state."""

    surfaces: list[SurfaceBlock]
    D: NDArray[np.float64]
    """(G, G) Hessian of the global unknowns."""
    g: NDArray[np.float64]
    """(G,) gradient."""
    schur: NDArray[np.float64] = field(init=False)
    """(G, G) Schur complement of the last :meth:`solve`."""

    @classmethod
    def empty(cls, sizes: list[int], bandwidths: list[int], columns: int) -> "NormalEquations":
        blocks = [
            SurfaceBlock(sp.csr_array((n, n)), Coupling((n, columns)), np.zeros(n), width)
            for n, width in zip(sizes, bandwidths, strict=True)
        ]
        return cls(blocks, np.zeros((columns, columns)), np.zeros(columns))

    def add_frame(
        self,
        surface: int,
        lin: Linearisation,
        residual: NDArray[np.float64],
        weight: NDArray[np.float64],
        chart: NDArray[np.float64],
    ) -> None:
        """Add one frame.

        Args:
            surface: index of the surface that the frame sees.
            lin: its linearisation of N pixels.
            residual: (2, N) rendered minus observed coordinates, zero where the weight is.
            weight: (N,) robust weights.
            chart: (L, G) from global steps to the frame's local ones.
        """
        block = self.surfaces[surface]
        block.A = block.A + surface_hessian(lin, weight)
        block.B.add(surface_products(lin, weight, lin.J_local), chart)
        block.g += surface_products(lin, weight, residual[:, None])[:, 0]
        for J, r in zip(lin.J_local, residual, strict=True):
            weighted = J * weight
            self.D += chart.T @ (weighted @ J.T) @ chart
            self.g += chart.T @ (weighted @ r)

    def add_global(self, hessian: NDArray[np.float64], gradient: NDArray[np.float64]) -> None:
        """Add a term over global unknowns only."""
        self.D += hessian
        self.g += gradient

    def solve(self, mu: float) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """Return the steps of the surfaces and of the global unknowns under damping ``mu``.

        Raises:
            numpy.linalg.LinAlgError: the damped system is not positive definite.
        """
        reduced = self.reduce(mu)
        self.schur = reduced.S
        S = reduced.S + mu * np.diag(np.diag(self.D))
        step = -_solve_symmetric(S, reduced.g)
        surfaces = [
            -factor.solve(block.g + block.B @ step)
            for factor, block in zip(reduced.factors, self.surfaces, strict=True)
        ]
        return surfaces, step

    def undamped(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the step (G,) of the global unknowns without damping, and the Schur complement."""
        reduced = self.reduce()
        return -_solve_symmetric(reduced.S, reduced.g), reduced.S

    def reduce(self, mu: float = 0.0) -> "Reduced":
        """Eliminate the surfaces."""
        S, g = self.D.copy(), self.g.copy()
        factors = [block.damped(mu) for block in self.surfaces]
        for block, factor in zip(self.surfaces, factors, strict=True):
            total = block.eliminated(factor)
            S -= total[:-1, :-1]
            g -= total[:-1, -1]
        return Reduced((S + S.T) / 2, g, factors)


@dataclass(eq=False)
class Reduced:
    """The normal equations after elimination of the surfaces."""

    S: NDArray[np.float64]
    """(G, G) Schur complement."""
    g: NDArray[np.float64]
    """(G,) reduced gradient."""
    factors: list[BandedCholesky]
    """Of every surface's A."""


def surface_hessian(lin: Linearisation, weight: NDArray[np.float64]) -> sp.csr_array:
    """Return J^T W J (V, V) of one frame over its surface, for weights (N,).

    Summed by triangle first: ten times faster than multiplying sparse matrices over pixels.
    """
    lattice, J = lin.lattice, lin.J_surface
    pattern = lattice.face_pattern
    data = np.zeros(len(pattern.indices))
    for i in range(3):
        for j in range(i, 3):
            product = weight * (J[0, i] * J[0, j] + J[1, i] * J[1, j])
            of_face = np.bincount(lin.faces, product, len(lattice.faces))
            for a, b in {(i, j), (j, i)}:
                data += np.bincount(pattern.positions[:, a, b], of_face, len(data))
    return sp.csr_array((data, pattern.indices, pattern.indptr), (lattice.size, lattice.size))


def surface_products(
    lin: Linearisation, weight: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return J^T W values (V, n) of one frame over its surface, for values (2, n, N) of u and v.

    Summed by triangle first, as in :func:`surface_hessian`.
    """
    lattice, J = lin.lattice, weight * lin.J_surface
    out = np.zeros((values.shape[1], lattice.size))
    for i in range(3):
        for row, (u, v) in zip(out, values.transpose(1, 0, 2), strict=True):
            of_face = np.bincount(lin.faces, J[0, i] * u + J[1, i] * v, len(lattice.faces))
            row += np.bincount(lattice.faces[:, i], of_face, lattice.size)
    return out.T


def surface_rows(lin: Linearisation, root: NDArray[np.float64], vertices: int) -> sp.csr_array:
    """Return the (2 N, V) Jacobian of u then v over one surface, rows scaled by ``root`` (N,)."""
    n = len(root)
    values = (lin.J_surface * root).transpose(0, 2, 1).ravel()
    columns = np.concatenate([lin.triangles, lin.triangles]).ravel()
    return sp.csr_array((values, columns, np.arange(0, 6 * n + 1, 3)), (2 * n, vertices))


def _solve_symmetric(S: NDArray[np.float64], g: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve S x = g after scaling the diagonal to one; directions without information stay put."""
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    values, vectors = np.linalg.eigh(S * np.outer(scale, scale))
    if len(values) and values[-1] <= 0:
        raise np.linalg.LinAlgError("no information")
    keep = values > 1e-12 * values.max(initial=0.0)
    inverse = np.where(keep, 1 / np.where(keep, values, 1.0), 0.0)
    return scale * (vectors @ (inverse * (vectors.T @ (scale * g))))

"""How well the unknowns are determined: the formal covariance, which trusts the model."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..elimination.banded_cholesky import BandedCholesky
from ..elimination.coupling import Coupling
from ..elimination.normal_equations import NormalEquations
from ..elimination.schur_complement import Reduced
from ..minimisers.result import OptimisationResult
from .jackknife import jackknives
from .response import response
from .sandwich_covariance import data_information

MODES = 6
"""Directions kept of what a calibration's error does to a surface."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariances of the global unknowns and of the surfaces."""

    sigma: float
    """Noise of one projector coordinate, pattern pixels, corrected for the fitted surface."""
    formal: NDArray[np.float64]
    """(G, G) formal covariance."""
    jackknife: NDArray[np.float64] | None
    """(G, G) block-jackknife covariance."""
    frame_jackknife: NDArray[np.float64] | None
    """(G, G) leaving out whole frames; for shared unknowns only."""
    surface_std: list[NDArray[np.float64]]
    """(V,) formal standard deviation of the values of every surface."""
    surface_modes: list[NDArray[np.float64]]
    """(V, K) what the values of every surface have in common: rows whose products are the
    covariances that come from the global unknowns."""


def uncertainty(
    result: OptimisationResult, reported: OptimisationResult, jackknife: bool
) -> Uncertainty:
    """Compute all covariances.

    Args:
        result: the calibration.
        reported: the same with the surface smoothed as it is reported; the data's information is
            taken there, where less noise passes for relief.
        jackknife: whether to compute the block jackknife too.
    """
    normal = result.normal_equations()
    reduced = normal.reduce()
    fitted = _fitted_unknowns(result, normal, reduced)
    variance, shrinkage = _noise(result, fitted)
    blocks, frames = jackknives(result, normal, reduced) if jackknife else (None, None)
    normal = reported.normal_equations()  # one of the two at a time: they are large
    reduced = normal.reduce()
    information = data_information(result, reported, normal, reduced, variance)
    S_inverse = information.covariance()
    scale = shrinkage * variance
    errors = [
        _surface_errors(factor, block.B, S_inverse)
        for factor, block in zip(reduced.factors, normal.surfaces, strict=True)
    ]
    return Uncertainty(
        sigma=float(np.sqrt(variance)),
        formal=scale * S_inverse,
        jackknife=blocks,
        frame_jackknife=frames,
        surface_std=[np.sqrt(scale * of_vertices) for of_vertices, _ in errors],
        surface_modes=[np.sqrt(scale) * modes for _, modes in errors],
    )


def _noise(result: OptimisationResult, fitted: float) -> tuple[float, float]:
    """Return the noise variance of one coordinate and the factor of the M-estimator's covariance.

    With psi(r) = w(r^2) r of two components, a = E|psi|^2 / 2 and b = E[w + w' r^2], the
    covariance is (a / b^2) (J^T J)^-1 (Huber); H = sum w J^T J replaces J^T J through E[w]. Under
    Gaussian noise E[w r^2] = 2 b sigma^2 (Stein). Residuals are smaller than the noise since the
    surface follows it: 2 N - p degrees of freedom are left.
    """
    loss, c = result.noise.loss, result.noise.scale
    r2 = np.concatenate([at.squared for at in result.evaluation.frames])
    r2 = r2[np.isfinite(r2)]
    w = loss.weight(r2, c)
    step = 1e-5 * c**2
    slope = (loss.weight(r2 + step, c) - w) / step
    a = float(np.mean(w * w * r2)) / 2
    b = float(np.mean(w + slope * r2))
    inliers = max(float(np.sum(w)) / b, 1.0)
    freedom = 2 * inliers / max(2 * inliers - fitted, 0.1 * inliers)
    variance = float(np.mean(w * r2)) / (2 * b) * freedom
    return variance, a / b**2 * float(np.mean(w)) * freedom / variance


def _fitted_unknowns(
    result: OptimisationResult, normal: NormalEquations, reduced: Reduced
) -> float:
    """Return the effective number of fitted unknowns, tr(H_data H^-1)."""
    total = float(len(reduced.g)) + sum(len(block.g) for block in normal.surfaces)
    for term in result.problem.smoothness:
        prior = sp.coo_array(term.hessian(result.state, result.noise))
        entries = reduced.factors[term.index].inverse_entries(*prior.coords)
        total -= float(entries @ prior.data)
    return total


def _surface_errors(
    factor: BandedCholesky, B: Coupling, covariance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return variances (V,) and shared modes of a surface's block of the inverse normal matrix.

    It is A^-1 + X C X^T with X = A^-1 B and the covariance C of the global unknowns, in noise
    variances.
    """
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    moved = response(factor, B, scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    n = np.arange(len(moved))
    return factor.inverse_entries(n, n) + np.einsum("vi,vi->v", moved, moved), shared_modes(moved)


def shared_modes(moved: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return modes M (V, K) whose product M M^T is that of ``moved`` but for its weakest part.

    Args:
        moved: (V, G) how vertices follow independent global unknowns of unit variance.

    Returns:
        At most :data:`MODES` columns.
    """
    _, strongest = np.linalg.eigh(moved.T @ moved)
    return moved @ strongest[:, ::-1][:, :MODES]

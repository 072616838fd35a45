"""How well the unknowns are determined: formal covariance and block jackknife.

The formal covariance trusts the model; the jackknife leaves out image blocks or whole frames and
so also sees errors of the model, which dominate on real captures.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .banded import BandedCholesky, BandedInverse
from .information import data_information
from .normal import Reduced, surface_rows
from .optimum import Optimum
from .problem import Problem
from .robust import Loss

BLOCKS = 4
"""Blocks along each side of an image."""
MIN_FRAMES = 4
"""Frames from which on leaving out whole frames is meaningful."""
MODES = 6
"""Directions kept of what a calibration's error does to a surface."""
_SMALLEST_BLOCK = 20
"""Observations below which a block is not worth leaving out."""


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
    rho_std: list[NDArray[np.float64]]
    """(V,) formal standard deviation of the inverse ranges of every surface."""
    rho_modes: list[NDArray[np.float64]]
    """(V, K) what the inverse ranges of every surface have in common: rows whose products are the
    covariances that come from the global unknowns."""
    information: NDArray[np.float64]
    """(G, G) information of the data over the noise variance; inverse of ``formal``."""


def uncertainty(optimum: Optimum, reported: Optimum, jackknife: bool) -> Uncertainty:
    """Compute all covariances.

    Args:
        optimum: the calibration.
        reported: the same with the surface smoothed as it is reported; the data's information is
            taken there, where less noise passes for relief.
        jackknife: whether to compute the block jackknife too.
    """
    problem, loss = optimum.objective.problem, optimum.objective.loss
    reduced = optimum.normal.reduce()
    inverses = [factor.inverse() for factor in reduced.factors]
    fitted = _fitted_unknowns(problem, optimum, reduced, inverses)
    variance, shrinkage = _noise(problem, optimum, loss, fitted)
    smooth = reported.normal.reduce()
    information = data_information(reported, smooth, variance)
    S_inverse = inverse_information(information)
    formal = shrinkage * variance * S_inverse
    blocks = _block_contributions(problem, optimum, reduced) if jackknife else None
    return Uncertainty(
        sigma=float(np.sqrt(variance)),
        formal=formal,
        jackknife=None if blocks is None else _jackknife(reduced, *blocks[:2]),
        frame_jackknife=None if blocks is None else _by_frame(reduced, *blocks),
        rho_std=[
            np.sqrt(shrinkage * variance * _surface_variance(factor, x[:, :-1], S_inverse))
            for factor, x in zip(smooth.factors, smooth.eliminated, strict=True)
        ],
        rho_modes=[shared_modes(x[:, :-1], formal) for x in smooth.eliminated],
        information=information / (shrinkage * variance),
    )


def _noise(problem: Problem, optimum: Optimum, loss: Loss, fitted: float) -> tuple[float, float]:
    """Return the noise variance of one coordinate and the factor of the M-estimator's covariance.

    With psi(r) = w(r^2) r of two components, a = E|psi|^2 / 2 and b = E[w + w' r^2], the
    covariance is (a / b^2) (J^T J)^-1 (Huber); H = sum w J^T J replaces J^T J through E[w]. Under
    Gaussian noise E[w r^2] = 2 b sigma^2 (Stein). Residuals are smaller than the noise since the
    surface follows it: 2 N - p degrees of freedom are left.
    """
    objective = optimum.objective
    r2 = np.concatenate([optimum.evaluation.squared(k) for k in range(len(problem.frames))])
    r2 = r2[np.isfinite(r2)]
    w = loss.weight(r2, objective.scale)
    step = 1e-5 * objective.scale**2
    slope = (loss.weight(r2 + step, objective.scale) - w) / step
    a = float(np.mean(w * w * r2)) / 2
    b = float(np.mean(w + slope * r2))
    inliers = max(float(np.sum(w)) / b, 1.0)
    freedom = 2 * inliers / max(2 * inliers - fitted, 0.1 * inliers)
    variance = float(np.mean(w * r2)) / (2 * b) * freedom
    return variance, a / b**2 * float(np.mean(w)) * freedom / variance


def _fitted_unknowns(
    problem: Problem, optimum: Optimum, reduced: Reduced, inverses: list[BandedInverse]
) -> float:
    """Return the effective number of fitted unknowns, tr(H_data H^-1)."""
    total = float(len(reduced.g))
    for surface, inverse, block, rho in zip(
        problem.surfaces, inverses, optimum.normal.surfaces, optimum.state.rho, strict=True
    ):
        prior = sp.coo_array(surface.prior.normal(rho, optimum.objective.sigma)[0])
        row, col = prior.coords
        entries = inverse.entries(row, col)
        total += len(block.g) - float(entries @ prior.data)
    return total


def _surface_variance(
    factor: BandedCholesky, coupling: NDArray[np.float64], S_inverse: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Diagonal of the surface's block of H^-1: A^-1 + X S^-1 X^T with X = A^-1 B."""
    n = np.arange(len(coupling))
    return factor.inverse().entries(n, n) + np.einsum("vi,vi->v", coupling @ S_inverse, coupling)


def shared_modes(
    coupling: NDArray[np.float64], covariance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return modes M (V, K) whose product M M^T is X C X^T, but for its weakest directions.

    Vertices follow the global unknowns by X = A^-1 B (V, G), whose covariance is C (G, G). K is
    at most :data:`MODES`.
    """
    if not len(covariance):
        return np.zeros((len(coupling), 0))
    values, vectors = np.linalg.eigh(covariance)
    moved = coupling @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    _, strongest = np.linalg.eigh(moved.T @ moved)
    return moved @ strongest[:, ::-1][:, :MODES]


def inverse_information(S: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert after scaling; directions without information get a huge variance, not infinity."""
    if not len(S):
        return S
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    values, vectors = np.linalg.eigh(S * np.outer(scale, scale))
    values = np.maximum(values, 1e-14 * values[-1])
    return np.outer(scale, scale) * ((vectors / values) @ vectors.T)


def _block_contributions(
    problem: Problem, optimum: Optimum, reduced: Reduced
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Split S and the reduced gradient by image block.

    S = sum_b (D_b - B_b^T X) with X = A^-1 B: exact, because D and B are sums over pixels.

    Returns:
        (K, G, G) and (K, G) contributions, (K,) frame of each block.
    """
    hessians, gradients, frames = [], [], []
    plan = problem.plan
    for k, frame in enumerate(problem.frames):
        lin, r = optimum.evaluation.linearisation(k), optimum.evaluation.residuals[k]
        root = np.sqrt(optimum.weights[k])
        X = reduced.eliminated[plan.surface_of(k)][:, :-1]
        chart = plan.local_to_global(optimum.state, k)
        n = len(root)
        local = (lin.J_local * root).transpose(0, 2, 1).reshape(2 * n, len(chart))
        surface = surface_rows(lin, root, len(X))
        weighted = (r * root).ravel()
        block = image_blocks(frame.pixels, frame.shape)
        for b in np.unique(block):
            rows = np.flatnonzero(block == b)
            if len(rows) < _SMALLEST_BLOCK:
                continue
            rows = np.concatenate([rows, rows + n])
            # Products over pixels first: rows as wide as all unknowns would fill the memory.
            L, Z, w = local[rows], surface[rows], weighted[rows]
            H = chart.T @ ((L.T @ L) @ chart - (Z.T @ L).T @ X)
            hessians.append((H + H.T) / 2)
            gradients.append(chart.T @ (L.T @ w) - X.T @ (Z.T @ w))
            frames.append(k)
    return np.array(hessians), np.array(gradients), np.array(frames)


def image_blocks(pixels: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Return the block index (N,) of pixels (x, y), in a grid over the part that they cover."""
    low = pixels.min(0)
    size = np.ptp(pixels, axis=0) + 1
    x, y = ((pixels - low) * BLOCKS // size).T
    return y * BLOCKS + x


def _jackknife(
    reduced: Reduced, hessians: NDArray[np.float64], gradients: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Delete-one jackknife covariance from one Newton step without each block.

    The step is -(S - S_b)^-1 (g - g_b); g, with the prior's part, vanishes at the optimum. Under
    pure noise the standard deviations are up to a quarter above the formal ones, because blocks
    differ in leverage, and scatter by 20-40 % about that, because blocks are few.
    """
    steps = []
    for H, g in zip(hessians, gradients, strict=True):
        rest = reduced.S - H
        values = np.linalg.eigvalsh(rest)
        if len(values) and values[0] <= 1e-12 * values[-1]:
            continue
        steps.append(np.linalg.solve(rest, g - reduced.g))
    if len(steps) < MIN_FRAMES:
        return None
    change = np.array(steps) - np.mean(steps, axis=0)
    return (len(steps) - 1) / len(steps) * change.T @ change


def _by_frame(
    reduced: Reduced,
    hessians: NDArray[np.float64],
    gradients: NDArray[np.float64],
    frames: NDArray[np.int64],
) -> NDArray[np.float64] | None:
    """Jackknife over whole frames; unknowns of the frame left out keep their value."""
    names = np.unique(frames)
    if len(names) < MIN_FRAMES:
        return None
    steps = []
    for k in names:
        rest = reduced.S - hessians[frames == k].sum(0)
        g = reduced.g - gradients[frames == k].sum(0)
        values, vectors = np.linalg.eigh(rest)
        inverse = np.where(values > 1e-9 * values[-1], 1 / np.maximum(values, 1e-300), 0.0)
        steps.append(-(vectors * inverse) @ (vectors.T @ g))
    change = np.array(steps) - np.mean(steps, axis=0)
    return (len(steps) - 1) / len(steps) * change.T @ change

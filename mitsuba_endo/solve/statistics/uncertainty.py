"""How well the unknowns are determined: formal covariance and block jackknife.

The formal covariance trusts the model; the jackknife leaves out image blocks or whole frames and
so also sees errors of the model, which dominate on real captures.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..cost.banded import BandedCholesky
from ..cost.coupling import Coupling
from ..cost.normal import NormalEquations, Reduced, surface_rows
from ..optimise.optimum import Optimum
from .information import data_information

BLOCKS = 4
"""Blocks along each side of an image."""
MIN_FRAMES = 4
"""Frames from which on leaving out whole frames is meaningful."""
MODES = 6
"""Directions kept of what a calibration's error does to a surface."""
_SMALLEST_BLOCK = 20
"""Observations below which a block is not worth leaving out."""
_COLUMNS = 32
"""Columns of the surface's response that are computed at once."""


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
    """(G, G) information of the data over the noise variance. Its inverse is a bound of
    ``formal``, which is reached where the relief outweighs the noise on the surface."""


def uncertainty(optimum: Optimum, reported: Optimum, jackknife: bool) -> Uncertainty:
    """Compute all covariances.

    Args:
        optimum: the calibration.
        reported: the same with the surface smoothed as it is reported; the data's information is
            taken there, where less noise passes for relief.
        jackknife: whether to compute the block jackknife too.
    """
    normal = optimum.normal_equations()
    reduced = normal.reduce()
    fitted = _fitted_unknowns(optimum, normal, reduced)
    variance, shrinkage = _noise(optimum, fitted)
    blocks, frames = _jackknives(optimum, normal, reduced) if jackknife else (None, None)
    normal = reported.normal_equations()  # one of the two at a time: they are large
    reduced = normal.reduce()
    information = data_information(optimum, reported, normal, reduced, variance)
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
        rho_std=[np.sqrt(scale * of_vertices) for of_vertices, _ in errors],
        rho_modes=[np.sqrt(scale) * modes for _, modes in errors],
        information=information.known / scale,
    )


def _noise(optimum: Optimum, fitted: float) -> tuple[float, float]:
    """Return the noise variance of one coordinate and the factor of the M-estimator's covariance.

    With psi(r) = w(r^2) r of two components, a = E|psi|^2 / 2 and b = E[w + w' r^2], the
    covariance is (a / b^2) (J^T J)^-1 (Huber); H = sum w J^T J replaces J^T J through E[w]. Under
    Gaussian noise E[w r^2] = 2 b sigma^2 (Stein). Residuals are smaller than the noise since the
    surface follows it: 2 N - p degrees of freedom are left.
    """
    objective, loss = optimum.objective, optimum.objective.loss
    frames = range(len(objective.problem.frames))
    r2 = np.concatenate([optimum.evaluation.squared(k) for k in frames])
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


def _fitted_unknowns(optimum: Optimum, normal: NormalEquations, reduced: Reduced) -> float:
    """Return the effective number of fitted unknowns, tr(H_data H^-1)."""
    objective, total = optimum.objective, float(len(reduced.g))
    for surface, factor, block, rho in zip(
        objective.problem.surfaces, reduced.factors, normal.surfaces, optimum.state.rho, strict=True
    ):
        prior = sp.coo_array(surface.prior.normal(rho, objective.sigma)[0])
        entries = factor.inverse_entries(*prior.coords)
        total += len(block.g) - float(entries @ prior.data)
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
    moved = _response(factor, B, scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
    n = np.arange(len(moved))
    return factor.inverse_entries(n, n) + np.einsum("vi,vi->v", moved, moved), shared_modes(moved)


def _response(
    factor: BandedCholesky, B: Coupling, directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how a surface answers, A^-1 B d (V, n), to directions d (G, n) of the globals."""
    out = np.empty((B.shape[0], directions.shape[1]))
    for start in range(0, out.shape[1], _COLUMNS):
        part = slice(start, start + _COLUMNS)
        out[:, part] = factor.solve(B @ directions[:, part])
    return out


def shared_modes(moved: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return modes M (V, K) whose product M M^T is that of ``moved`` but for its weakest part.

    Args:
        moved: (V, G) how vertices follow independent global unknowns of unit variance.

    Returns:
        At most :data:`MODES` columns.
    """
    _, strongest = np.linalg.eigh(moved.T @ moved)
    return moved @ strongest[:, ::-1][:, :MODES]


def _block_contributions(
    optimum: Optimum, frame: int, X: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the parts (G, G) of S and (G,) of the reduced gradient of a frame's image blocks.

    With the surface following the global unknowns, X = A^-1 B, the rows of a pixel are K = J_global
    - J_surface X; S is the sum of K^T K and of what the prior resists. Every part is positive, so
    that leaving one out never invents information about what other frames see of the block.

    Args:
        optimum: where.
        frame: index of the frame.
        X: (V, G) of the surface that the frame sees.
    """
    problem = optimum.objective.problem
    lin, r = optimum.evaluation.linearisation(frame), optimum.evaluation.residuals[frame]
    root = np.sqrt(optimum.weights[frame])
    chart = problem.plan.local_to_global(optimum.state, frame)
    n = len(root)
    local = (lin.J_local * root).transpose(0, 2, 1).reshape(2 * n, len(chart))
    surface = surface_rows(lin, root, len(X))
    weighted = (r * root).ravel()
    block = image_blocks(problem.frames[frame].pixels, problem.frames[frame].shape)
    for b in np.unique(block):
        rows = np.flatnonzero(block == b)
        if len(rows) < _SMALLEST_BLOCK:
            continue
        rows = np.concatenate([rows, rows + n])
        # Products over pixels first: rows as wide as all unknowns would fill the memory.
        L, Z, w = local[rows], surface[rows], weighted[rows]
        coupling = (Z.T @ L).T
        seen = np.flatnonzero(coupling.any(0))
        Z, near = Z[:, seen], X[seen]
        cross = chart.T @ coupling[:, seen] @ near
        H = chart.T @ (L.T @ L) @ chart - cross - cross.T + near.T @ (Z.T @ Z @ near)
        yield H, chart.T @ (L.T @ w) - near.T @ (Z.T @ w)


def image_blocks(pixels: NDArray[np.integer], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Return the block index (N,) of pixels (x, y), in a grid over the part that they cover."""
    low = pixels.min(0)
    size = np.ptp(pixels, axis=0) + 1
    x, y = ((pixels - low) * BLOCKS // size).T
    return y * BLOCKS + x


def _jackknives(
    optimum: Optimum, normal: NormalEquations, reduced: Reduced
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return delete-one jackknife covariances (G, G) over image blocks and over whole frames.

    Under pure noise the blocks' standard deviations are up to a quarter above the formal ones,
    because blocks differ in leverage, and scatter by 20-40 % about that, because blocks are few.
    Unknowns of a frame left out keep their value.
    """
    responses = [
        _response(factor, block.B, np.eye(len(reduced.g)))
        for factor, block in zip(reduced.factors, normal.surfaces, strict=True)
    ]
    blocks, frames = [], []
    for k in range(optimum.objective.problem.plan.frames):
        total_H, total_g = np.zeros_like(reduced.S), np.zeros_like(reduced.g)
        X = responses[optimum.objective.problem.plan.surface_of(k)]
        for H, g in _block_contributions(optimum, k, X):
            blocks.append(_step_without(reduced, H, g))
            total_H += H
            total_g += g
        if total_H.any():
            frames.append(_step_without_frame(reduced, total_H, total_g))
    return _delete_one([s for s in blocks if s is not None]), _delete_one(frames)


def _step_without(
    reduced: Reduced, H: NDArray[np.float64], g: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the Newton step -(S - H)^-1 (g_S - g) without a block, None if it is undetermined.

    g_S, with the prior's part, vanishes at the optimum.
    """
    rest = reduced.S - H
    values = np.linalg.eigvalsh(rest)
    if len(values) and values[0] <= 1e-12 * values[-1]:
        return None
    return np.linalg.solve(rest, g - reduced.g).astype(np.float64)


def _step_without_frame(
    reduced: Reduced, H: NDArray[np.float64], g: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the same without a frame; unknowns that only it tells keep their value."""
    values, vectors = np.linalg.eigh(reduced.S - H)
    known = values > 1e-9 * values.max(initial=0.0)
    inverse = np.where(known, 1 / np.maximum(values, 1e-300), 0.0)
    return (vectors * inverse) @ (vectors.T @ (g - reduced.g))


def _delete_one(steps: list[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return the jackknife covariance of the steps that leaving one part out causes."""
    if len(steps) < MIN_FRAMES:
        return None
    change = np.array(steps)
    change -= change.mean(0)
    return (len(steps) - 1) / len(steps) * change.T @ change

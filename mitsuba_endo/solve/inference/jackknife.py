"""The jackknife: what leaving out image blocks or whole frames changes.

Unlike the formal covariance it also sees errors of the model, which dominate on real captures.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..elimination.normal_equations import NormalEquations, surface_rows
from ..elimination.schur_complement import Reduced
from ..minimisers.result import OptimisationResult
from .response import response

BLOCKS = 4
"""Blocks along each side of an image."""
MIN_FRAMES = 4
"""Frames from which on leaving out whole frames is meaningful."""
_SMALLEST_BLOCK = 20
"""Observations below which a block is not worth leaving out."""
_SINGULAR = 1e-12
"""Eigenvalue over the largest, scaled: below, the block left out held all information."""
_ONLY_HERE = 1e-9
"""The same, at which a direction is one that only the frame left out tells."""


def _block_contributions(
    result: OptimisationResult, frame: int, X: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the parts (G, G) of S and (G,) of the reduced gradient of a frame's image blocks.

    With the surface following the global unknowns, X = A^-1 B, the rows of a pixel are K = J_global
    - J_surface X; S is the sum of K^T K and of what the prior resists. Every part is positive, so
    that leaving one out never invents information about what other frames see of the block.

    Args:
        result: where.
        frame: index of the frame.
        X: (V, G) of the surface that the frame sees.
    """
    problem = result.problem
    lin, r = result.evaluation.linearisation(frame), result.evaluation.frames[frame].residual
    root = np.sqrt(result.weights[frame])
    T = problem.layout.local_from_global(result.state, frame)
    n = len(root)
    local = (lin.J_local * root).transpose(0, 2, 1).reshape(2 * n, len(T))
    surface = surface_rows(lin, root, len(X))
    weighted = (r * root).ravel()
    block = image_blocks(problem.observed[frame].pixels)
    for b in np.unique(block):
        rows = np.flatnonzero(block == b)
        if len(rows) < _SMALLEST_BLOCK:
            continue
        rows = np.concatenate([rows, rows + n])
        # Products over pixels first: rows as wide as all unknowns would fill the memory.
        L, Z, w = local[rows], surface[rows], weighted[rows]
        coupling = (Z.T @ L).T
        coupled = np.flatnonzero(coupling.any(0))
        Z, near = Z[:, coupled], X[coupled]
        cross = T.T @ coupling[:, coupled] @ near
        H = T.T @ (L.T @ L) @ T - cross - cross.T + near.T @ (Z.T @ Z @ near)
        yield H, T.T @ (L.T @ w) - near.T @ (Z.T @ w)


def image_blocks(pixels: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the block index (N,) of pixels (x, y), in a grid over the part that they cover."""
    low = pixels.min(0)
    size = np.ptp(pixels, axis=0) + 1
    x, y = ((pixels - low) * BLOCKS // size).T
    return y * BLOCKS + x


def jackknives(
    result: OptimisationResult, normal: NormalEquations, reduced: Reduced
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Return delete-one jackknife covariances (G, G) over image blocks and over whole frames.

    Under pure noise the blocks' standard deviations are up to a quarter above the formal ones,
    because blocks differ in leverage, and scatter by 20-40 % about that, because blocks are few.
    Unknowns of a frame left out keep their value.
    """
    responses = [
        response(factor, block.B, np.eye(len(reduced.g)))
        for factor, block in zip(reduced.factors, normal.surfaces, strict=True)
    ]
    blocks, frames = [], []
    for k, surface in enumerate(result.problem.layout.surface_of):
        total_H, total_g = np.zeros_like(reduced.S), np.zeros_like(reduced.g)
        X = responses[surface]
        for H, g in _block_contributions(result, k, X):
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
    scale, values, vectors = _scaled(reduced.S, H)
    if len(values) and values[0] <= _SINGULAR * values[-1]:
        return None
    return scale * (vectors @ ((vectors.T @ (scale * (g - reduced.g))) / values))


def _step_without_frame(
    reduced: Reduced, H: NDArray[np.float64], g: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the same without a frame; unknowns that only it tells keep their value."""
    scale, values, vectors = _scaled(reduced.S, H)
    determined = values > _ONLY_HERE * values.max(initial=0.0)
    inverse = np.where(determined, 1 / np.maximum(values, 1e-300), 0.0)
    return scale * (vectors @ (inverse * (vectors.T @ (scale * (g - reduced.g)))))


def _scaled(
    S: NDArray[np.float64], H: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the scale that gives S a unit diagonal, and the eigensystem of S - H so scaled.

    Unknowns come in pixels, radians and logarithms: unscaled, those of large units look singular.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    values, vectors = np.linalg.eigh((S - H) * np.outer(scale, scale))
    return scale, values, vectors


def _delete_one(steps: list[NDArray[np.float64]]) -> NDArray[np.float64] | None:
    """Return the jackknife covariance of the steps that leaving one part out causes."""
    if len(steps) < MIN_FRAMES:
        return None
    change = np.array(steps)
    change -= change.mean(0)
    return (len(steps) - 1) / len(steps) * change.T @ change

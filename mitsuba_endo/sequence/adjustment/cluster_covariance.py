"""Covariance of the adjusted poses: a sandwich, whatever errors the pixels of a block share.

With H the cost's second derivatives and V the sum of s s^T over blocks of the frames' images, s
being a block's share of the gradient after the elements were eliminated, it is H^-1 V H^-1 (White;
Liang and Zeger, 1986, blocks as clusters). Residuals are smaller than the errors that made them, by
what the elements take up, which is undone; what twelve unknowns a frame take of its blocks is not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from ..placement import mean_curvature
from .equations import FRAME, Equations, Weights, columns_of
from .observations import BLOCKS, Seen

Floats = NDArray[np.float64]

_LEAST_LEFT = 0.05
"""Share of an error that is left in its residual, at least: what one frame alone tells of an
element says nothing of errors."""


@dataclass(frozen=True, eq=False)
class Covariance:
    """Of all unknowns of an adjustment."""

    matrix: Floats
    """(12 K + 1, 12 K + 1) of the frames' steps, see :meth:`Poses.moved`, and the log of the focal
    length."""

    def of_frame(self, k: int) -> Floats:
        """Return the block (12, 12) of a frame."""
        at = slice(FRAME * k, FRAME * (k + 1))
        return self.matrix[at, at]

    @property
    def focal_std(self) -> float:
        """Of the log of the focal length."""
        return float(np.sqrt(max(self.matrix[-1, -1], 0.0)))


def curvature_weights(observations: Seen) -> Weights:
    """Return weights that make the cost's second derivatives, in the mean over residuals."""
    across = mean_curvature(observations.across)
    along = mean_curvature(observations.along)
    return Weights(np.full(len(observations.across), across), along * observations.on_line)


def scatter(all_observations: Sequence[Seen], at: Equations, weights: Sequence[Weights]) -> Floats:
    """Return V (n, n), see the module.

    Args:
        all_observations: by each frame, at the solution.
        at: equations under the curvature's weights.
        weights: these.
    """
    V = np.zeros_like(at.A)
    for k, (s, w) in enumerate(zip(all_observations, weights, strict=True)):
        columns, scores = _scores(k, s, w, at)
        V[np.ix_(columns, columns)] += scores.T @ scores
    return V


def _scores(
    k: int, observations: Seen, weights: Weights, at: Equations
) -> tuple[NDArray[np.int64], Floats]:
    """Return the unknowns (C,) on which a frame's gradient depends, and its blocks' shares
    (blocks, C).
    """
    size, information = len(at.A), at.information[observations.element]
    informed = information > 0
    share = weights.along * observations.by_element**2 / np.where(informed, information, 1.0)
    left = (observations.along - observations.by_element * at.mean[observations.element]) / np.sqrt(
        np.maximum(1 - share, _LEAST_LEFT)
    )
    score = np.where(informed, observations.weight * left, 0.0)
    rows = observations.by_unknowns * score + observations.across_by_unknowns * (
        observations.on_line * observations.across
    )
    count = BLOCKS[0] * BLOCKS[1]
    own = np.stack([np.bincount(observations.block, row, count) for row in rows], axis=1).astype(
        float
    )
    parts = [(columns_of(k, size), own)]
    for response in at.responses:
        here = response.among(observations.element)
        if here.start == here.stop:
            continue
        by_block = sp.csr_array(
            (
                (score * observations.by_element)[here],
                (observations.block[here], observations.element[here] - response.first),
            ),
            shape=(count, response.g.shape[1]),
        )
        parts.append((response.columns, -(by_block @ response.g.T)))
    return _summed(parts, size, count)


def _summed(
    parts: Sequence[tuple[NDArray[np.int64], Floats]], size: int, count: int
) -> tuple[NDArray[np.int64], Floats]:
    columns = np.unique(np.concatenate([c for c, _ in parts]))
    column_index = np.zeros(size, np.int64)
    column_index[columns] = np.arange(len(columns))
    out = np.zeros((count, len(columns)))
    for part, values in parts:
        out[:, column_index[part]] += values  # a part has each column once
    return columns, out


def covariance(H: Floats, V: Floats, free: NDArray[np.bool_]) -> Covariance:
    """Return H^-1 V H^-1 of the free unknowns, zero for the others."""
    at = np.ix_(free, free)
    inverse = scipy.linalg.cho_solve(scipy.linalg.cho_factor(H[at]), np.eye(int(free.sum())))
    out = np.zeros_like(H)
    out[at] = inverse @ V[at] @ inverse
    return Covariance(out)

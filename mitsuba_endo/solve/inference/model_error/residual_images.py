"""Residuals of a fit as images, and what their correlation says, all frames together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....residual_statistics.design_effect import DesignEffect, design_effect
from ....residual_statistics.structure import SMOOTHING_PX, Structure, structure
from ...costs.coordinate_residual import Observations
from ...minimisers.result import OptimisationResult

Floats = NDArray[np.float64]

_GAP = int(np.ceil(4 * SMOOTHING_PX)) + 1
"""Rows between frames, so that smoothing does not mix them."""


@dataclass(frozen=True, eq=False)
class Correlation:
    """What the residuals of all frames hold beside white noise."""

    structure: Structure
    effect: DesignEffect


def residual_correlation(
    result: OptimisationResult, residuals: Sequence[Floats] | None = None
) -> Correlation:
    """Return structure and design effect of whitened residuals.

    Args:
        result: whose weights, and whose residuals unless others are given.
        residuals: (2, N) of every frame.
    """
    own = [at.residual for at in result.evaluation.frames]
    images = [
        _images(term.observed, r, np.where(at.hits, w, 0.0))
        for term, at, r, w in zip(
            result.problem.frames, result.evaluation.frames,
            own if residuals is None else residuals, result.weights, strict=True,
        )
    ]  # fmt: skip
    padded = [_padded(*image) for image in images]
    residual, weight = (np.concatenate([p[i] for p in padded]) for i in (0, 1))
    return Correlation(structure(residual, weight), _pooled([design_effect(*i) for i in images]))


def _images(observed: Observations, residual: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Return residuals (H, W, 2), NaN = missing, and weights (H, W)."""
    x, y = observed.pixels.T
    r, w = np.full((*observed.shape, 2), np.nan), np.zeros(observed.shape)
    r[y, x], w[y, x] = residual.T, weight
    return r, w


def _padded(residual: Floats, weight: Floats) -> tuple[Floats, Floats]:
    gap = ((0, _GAP), (0, 0))
    return np.pad(residual, (*gap, (0, 0)), constant_values=np.nan), np.pad(weight, gap)


def _pooled(effects: Sequence[DesignEffect]) -> DesignEffect:
    """Return the mean over frames at each length, weighted by their independent blocks."""
    if len(effects) == 1:
        return effects[0]
    lengths = sorted({int(n) for e in effects for n in e.lengths})
    values, blocks = [], []
    for length in lengths:
        at = [(e, list(e.lengths).index(length)) for e in effects if length in e.lengths]
        share = np.array([e.blocks[i] for e, i in at])
        values.append(share @ np.array([e.values[i] for e, i in at]) / share.sum())
        blocks.append(share.sum())
    return DesignEffect(np.array(lengths, int), np.array(values), np.array(blocks, float))

"""Where a minimiser ended."""

import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..costs.noise_scale import NoiseScale
from ..costs.objective import Evaluation, Problem
from ..elimination.normal_equations import NormalEquations
from ..unknowns.state import State

USED_WEIGHT = 0.1
"""Robust weight above which a correspondence counts as used."""
_QUANTILES = 256
"""Chosen: the cost made of them is then right to a percent."""


@dataclass(frozen=True, eq=False)
class OptimisationResult:
    """The last state, with what inference needs."""

    outcome: Outcome
    evaluation: Evaluation
    noise: NoiseScale
    trace: list[TraceRow]

    @property
    def state(self) -> State:
        return self.evaluation.state

    @property
    def problem(self) -> Problem:
        return self.evaluation.problem

    @cached_property
    def weights(self) -> list[NDArray[np.float64]]:
        """Robust weights (N,) of every frame."""
        return self.evaluation.weights(self.noise)

    @cached_property
    def cost(self) -> float:
        """Pattern pixels squared."""
        return self.evaluation.cost(self.noise)

    def normal_equations(self) -> NormalEquations:
        """Accumulate the normal equations, which few need and nobody keeps."""
        return self.evaluation.normal_equations(self.noise)

    def support(self, frame: int) -> NDArray[np.float64]:
        """Return the robust weight (V,) of one frame's observations around every vertex."""
        surface = self.problem.surface_seen_by(frame)
        hit_faces = self.evaluation.frames[frame].faces
        of_face = np.bincount(hit_faces, self.weights[frame], len(surface.faces))
        total = np.bincount(surface.faces.ravel(), np.repeat(of_face, 3), surface.size)
        return total.astype(np.float64)


def trace_row(
    at: Evaluation, noise: NoiseScale, iteration: int, began: float, size: float, damping: float
) -> TraceRow:
    """Describe an iteration of an optimisation that began at ``began`` (``perf_counter``)."""
    focals = set(at.state.focals)
    return TraceRow(
        iteration=iteration,
        seconds=time.perf_counter() - began,
        cost=at.cost(noise) / max(at.problem.observations, 1) / noise.sigma**2,
        focal=focals.pop() if len(focals) == 1 else None,
        damping=damping,
        scale_px=noise.scale,
        step=size,
        lengths=_quantiles(at),
    )


def _quantiles(at: Evaluation) -> tuple[float, ...]:
    """Return quantiles of the residuals' lengths; those of missed correspondences are infinite."""
    squared = np.concatenate([frame.squared for frame in at.frames])
    ordered = np.sort(np.where(np.isfinite(squared), squared, np.inf))
    indices = ((np.arange(_QUANTILES) + 0.5) / _QUANTILES * len(ordered)).astype(int)
    return tuple(np.sqrt(ordered[indices]).tolist()) if len(ordered) else ()


def with_fixed_cost(trace: list[TraceRow], noise: NoiseScale) -> list[TraceRow]:
    """Return a trace whose rows are judged by one loss, that of the end.

    The loss that an iteration minimises follows the residuals, so its values cannot be compared
    with one another; under one loss they fall.
    """
    return [replace(row, fixed_cost=_cost_of(row.lengths, noise), lengths=()) for row in trace]


def _cost_of(lengths: tuple[float, ...], noise: NoiseScale) -> float | None:
    if not lengths:
        return None
    far = 1e6 * noise.scale  # a residual that is missed costs what the loss has at most
    squared = np.minimum(np.array(lengths), far) ** 2
    return float(np.mean(noise.loss(squared, noise.scale)) / noise.sigma**2)

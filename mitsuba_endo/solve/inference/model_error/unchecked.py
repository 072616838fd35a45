"""Given values that the maps cannot check: grossly wrong, they would leave no trace but move poses.

Before a surface that is nearly plane, poses and relief can make up for a wrong aspect ratio. The
residuals then look like noise, and no interval knows. To first order noise passes for relief that
would show it, so what such an error costs is found by solving with it, on epipolar residuals.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....records.rig import Rig
from ...unknowns.block import BLOCKS
from .epipolar_fit import possible
from .epipolar_solve import (
    EpipolarSample,
    ModelVariant,
    Point,
    noise_of,
    point_at,
    robust_cost,
    sampled,
    solved,
)
from .extended import Extended
from .score_tests import Testable, candidates

Floats = NDArray[np.float64]

_DOUBTED, _MOST = 8.0, 4
"""Deviations from noise alone, as the first order has them, of a gross error above which the maps
check a value, and how many values are tried at most, those that the maps see least first. Chosen:
where the first order errs, it does so by a factor of two or three."""
_TRACELESS = 10.0
"""Rise of the cost, noise variances, that no test notices: it is lost among some 16 candidates."""
_MATTERS = 3.0
"""Standard deviations by which an unknown must move for a value to be told of."""
_PIXELS = 2000
"""In the sample, about; what a rise in it means for all is in proportion."""
_ITERATIONS = 20
"""Of the minimiser at most. Chosen: most end after five."""


@dataclass(frozen=True)
class Unchecked:
    """One given value that the maps cannot check."""

    key: str
    words: str
    error: float
    """That would leave no trace, in its unit: one that no careful calibration makes."""
    unit: str
    moved: float
    """Standard deviations, at most, by which it would move an unknown."""


def unchecked(extended: Extended, rig: Rig, variance: float) -> list[Unchecked]:
    """Return the values that could be grossly wrong without a trace, with what that would do.

    Only where frames have surfaces of their own: epipolar residuals know no other tie.

    Args:
        extended: a fit whose residuals look like noise, with its given values' columns.
        rig: of it.
        variance: of one whitened coordinate.
    """
    problem = extended.result.problem
    own = problem.layout.surfaces == problem.layout.frames
    doubted = _doubted(extended, rig, variance) if own else []
    if not doubted or not possible(problem, extended.result.state):
        return []
    sample, none = sampled(extended.result, rig, _PIXELS), ModelVariant("", problem.law)
    base = solved(sample, none, point_at(sample, none, extended.result.state), _ITERATIONS)
    tried = [_tried(extended, sample, base, c, variance) for c in doubted]
    return sorted((f for f in tried if f is not None), key=lambda f: -f.moved)


def _doubted(extended: Extended, rig: Rig, variance: float) -> list[Testable]:
    """Return the given values of which the first order does not say that the maps check them."""
    given = [c for c in candidates(extended, rig) if c.block is not None and np.isfinite(c.limit)]
    if not given:
        return []
    _, information, _ = extended.directions(np.array([c.direction for c in given]).T)
    deviations = [c.limit * np.sqrt(max(i, 0.0) / variance)
                  for c, i in zip(given, np.diag(information), strict=True)]  # fmt: skip
    order = sorted(zip(deviations, range(len(given)), strict=True))
    return [given[i] for d, i in order[:_MOST] if d < _DOUBTED]


def _tried(
    extended: Extended, sample: EpipolarSample, base: Point, candidate: Testable, variance: float
) -> Unchecked | None:
    """Return a value of which a gross error leaves no trace but moves an unknown."""
    s = extended.solved
    std = np.sqrt(variance * np.diag(np.linalg.pinv(extended.S[np.ix_(s, s)], hermitian=True)))
    noise, all_ = noise_of(base.r), extended.result.problem.observations / len(base.r)
    moved = 0.0
    for error in (candidate.limit, -candidate.limit):
        end = _displaced(sample, base, candidate, error)
        rise = all_ * (robust_cost(end.r, noise) - robust_cost(base.r, noise))
        by = np.abs(sample.layout.difference(base.state, end.state)) / std
        moved = max(moved, float(by.max())) if rise < _TRACELESS else moved
    if moved < _MATTERS:
        return None
    return Unchecked(candidate.key, candidate.words, candidate.limit, candidate.unit, moved)


def _displaced(sample: EpipolarSample, base: Point, candidate: Testable, error: float) -> Point:
    """Solve with a given value displaced by so many of its units."""
    name, none = candidate.block or "", ModelVariant("", base.frames[0].law)
    assert candidate.step is not None  # only blocks are asked
    value = BLOCKS[name].retract(sample.given[name], error * candidate.step)
    held = replace(sample, given={**sample.given, name: value})
    state = base.state
    values = {**state.values, name: (value,) * len(state.values[name])}
    return solved(held, none, point_at(held, none, replace(state, values=values)), _ITERATIONS)

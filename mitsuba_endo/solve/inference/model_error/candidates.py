"""What may be wrong, from score tests and refits: one list, the most likely first, with groups."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...unknowns.block import BLOCKS
from ...unknowns.state import State
from .refits import AS_GOOD, PLAN, Refit
from .score_tests import ModelCandidate, Tests

GROSS = 60.0
"""Gain of a refit, noise variances in its sample, from which on it says more than the prediction to
first order from all pixels."""
ALIKE = 9.0
"""Difference of gains, in noise variances, below which the data do not choose: three deviations."""
_MATRIX_WORDS = "camera matrix (focal length and centre)"


@dataclass(frozen=True, eq=False)
class Named:
    """Candidates and what the best of them would change."""

    candidates: list[ModelCandidate]
    """The most likely first; each with the words of others that explain as much."""
    gross: bool = False
    """Whether refits decided the order."""
    explained: float = 0.0
    """Share of the residuals' energy that the best refit takes away."""
    shifts: list[NDArray[np.float64]] = field(default_factory=list)
    """(G,) by how much the fit's unknowns move with each of those that explain as much."""
    plan: str | None = None
    """Block of which each frame has its own, if that is the first cause."""
    ends: list[State] = field(default_factory=list)
    """Where the refits of those under the fit's own projection model ended."""


def named(tests: Tests, refits: Sequence[Refit], law: str) -> Named:
    """Return the candidates in the order in which they explain the residuals.

    Args:
        tests: of the fit.
        refits: the best first.
        law: projection model of the fit.
    """
    best = max((r.gain for r in refits), default=0.0)
    if best < GROSS:
        return _by_scores(tests)
    by_key = {c.key: c for c in tests.candidates}
    first = [_candidate(r, by_key.get(r.variant.key)) for r in refits if r.variant.layout is None]
    keys = {c.key for c in first}
    rest = [replace(c, gain=0.0) for c in tests.candidates if c.key not in keys]
    as_good = [r for r in refits if r.gain > _enough(best, ALIKE)]
    plan = (
        refits[0].variant.key.removeprefix(PLAN) if refits[0].variant.layout is not None else None
    )
    shifts = [r.shift for r in as_good if r.shift is not None]
    left = min(r.left for r in as_good)
    ends = [r.end for r in as_good if r.variant.layout is None and r.variant.law == law]
    return Named([*_grouped(first, ALIKE), *rest], True, 1 - left, shifts, plan, ends)


def _by_scores(tests: Tests) -> Named:
    noise = ALIKE * tests.noise
    single = max((c.gain for c in tests.candidates), default=0.0)
    # What needs several values of a block comes first only where no single value does as well.
    blocks = [c for c in tests.blocks if single < _enough(c.gain, noise)]
    ordered = _grouped(sorted([*tests.candidates, *blocks], key=lambda c: -c.gain), noise)
    best = max((c.gain for c in ordered), default=0.0)
    shifts = [c.shift for c in ordered if c.shift is not None and c.gain > _enough(best, noise)]
    return Named(ordered, shifts=shifts)


def _enough(best: float, noise: float) -> float:
    """Return the gain from which on a candidate explains as much as the best one."""
    return min(AS_GOOD * best, best - noise)


def _candidate(refit: Refit, tested: ModelCandidate | None) -> ModelCandidate:
    """Return a candidate with the value that a refit found."""
    key = refit.variant.key
    if tested is None:
        block = refit.variant.steps[0][0] if refit.variant.steps else None
        words = BLOCKS[key].words if key in BLOCKS else _MATRIX_WORDS
        tested = ModelCandidate(key, words, "", block, 0.0, np.inf, 0.0)
    value, share = refit.value, 1 - refit.left
    return replace(tested, value=value, gain=refit.gain, shift=refit.shift, share=share)


def _grouped(candidates: Sequence[ModelCandidate], noise: float) -> list[ModelCandidate]:
    """Return the candidates, the first with the words of those that explain as much."""
    if not candidates:
        return []
    best = max(c.gain for c in candidates)
    alike = [(c.key, c.words) for c in candidates[1:] if c.gain > _enough(best, noise)]
    return [replace(candidates[0], group=tuple(alike)), *candidates[1:]]

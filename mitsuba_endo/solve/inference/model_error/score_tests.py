"""Lagrange multiplier tests of what a model leaves out (Rao 1948), without solving anew.

A candidate is a direction in the space of given values or specials. Made orthogonal to all that is
solved for, its information I and score g predict the value -g / I by which it is off and the fall
g^2 / I of the sum of squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ...unknowns.block import BLOCKS
from .extended import Extended, given_blocks
from .residual_images import Correlation, residual_correlation

Floats = NDArray[np.float64]

ALIKE = 0.95
"""Correlation of what two candidates do to the residuals from which on the data cannot tell them
apart."""
_RANK = 1e-6
"""Eigenvalue of the candidates' correlation below which a direction repeats others."""
_UNSEEN = 1e-8
"""Share of a candidate's own information that must be left beside the unknowns."""


@dataclass(frozen=True, eq=False)
class ModelCandidate:
    """One thing that may be wrong, and what the residuals say of it."""

    key: str
    words: str
    unit: str
    block: str | None
    """Whose given value it is; None for what is no block."""
    value: float
    """What mends it, to first order, in its unit."""
    std: float
    """Standard deviation of it, with the residuals' correlation."""
    gain: float
    """Fall of the weighted sum of squared residuals."""
    group: tuple[str, ...] = ()
    """Words of others whose effect is nearly the same."""

    @property
    def deviations(self) -> float:
        return abs(self.value) / self.std


@dataclass(frozen=True, eq=False)
class Tests:
    """All candidates, the most explaining first."""

    candidates: list[ModelCandidate]
    before: Correlation
    """Of the residuals."""
    after: Correlation
    """Of what is left of them when every candidate has its predicted value."""
    energy: float
    """Weighted sum of squared residuals."""
    gain: float
    """Its fall by all candidates together."""
    chance: float
    """Probability that correlated noise without any error of the model lets it fall so far."""


def score_tests(extended: Extended, variance: float) -> Tests:
    """Test every candidate.

    Args:
        extended: the fit with the candidates' columns.
        variance: of one whitened coordinate.
    """
    named = _candidates(extended)
    columns = np.array([direction for *_, direction in named]).T
    W, information, score = extended.directions(columns)
    own = np.einsum("gk,gh,hk->k", columns, extended.S, columns)
    seen = np.diag(information) > _UNSEEN * own
    named = [n for n, is_seen in zip(named, seen, strict=True) if is_seen]
    W, information, score = W[:, seen], information[np.ix_(seen, seen)], score[seen]
    step, rank = _joint(information, score)
    gain = float(-score @ step)
    left = [
        at.residual + np.where(at.hits, extended.derivatives(k, (W @ step)[:, None])[:, 0], 0.0)
        for k, at in enumerate(extended.result.evaluation.frames)
    ]
    before = residual_correlation(extended.result)
    after = residual_correlation(extended.result, left)
    noise = variance * after.effect.largest
    found = [
        ModelCandidate(key, words, unit, block, -g / i, float(np.sqrt(noise / i)), g * g / i)
        for (key, words, unit, block, _), g, i in zip(
            named, score, np.diag(information), strict=True
        )
    ]
    energy = sum(
        float((w * at.squared)[at.hits].sum())
        for w, at in zip(extended.result.weights, extended.result.evaluation.frames, strict=True)
    )
    chance = float(chi2.sf(gain / noise, max(rank, 1)))
    return Tests(_grouped(found, information), before, after, energy, gain, chance)


def _candidates(extended: Extended) -> list[tuple[str, str, str, str | None, Floats]]:
    """Return key, words, unit, block and direction (G,) of every candidate."""
    layout, size = extended.layout, len(extended.g)
    out: list[tuple[str, str, str, str | None, Floats]] = []
    for name in given_blocks(extended.result.problem.layout):
        for owner in sorted(set(layout.owners[name])):
            if (name, owner) not in layout.slots:
                continue
            T = layout.tangent_map(extended.state, name, owner)
            for suspect in BLOCKS[name].suspects(layout.names[name]):
                direction = np.zeros(size)
                direction[layout.slots[name, owner]] = T.T @ suspect.step
                key = f"{name}.{suspect.part}" if suspect.part else name
                out.append((key, suspect.words, suspect.unit, name, direction))
    for i, special in enumerate(extended.specials):
        direction = np.zeros(size)
        direction[layout.columns + i] = 1.0
        out.append((special.key, special.words, special.unit, None, direction))
    return out


def _joint(information: Floats, score: Floats) -> tuple[Floats, int]:
    """Return the step (K,) of all candidates together, and how many directions they span."""
    if not len(score):
        return score, 0
    scale = 1 / np.sqrt(np.diag(information))
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    kept = values > _RANK * values[-1]
    turned = vectors.T @ (scale * score)
    step = scale * (vectors[:, kept] @ (turned[kept] / values[kept]))
    return -step, int(kept.sum())


def _grouped(found: Sequence[ModelCandidate], information: Floats) -> list[ModelCandidate]:
    scale = 1 / np.sqrt(np.diag(information)) if len(found) else np.zeros(0)
    alike = np.abs(information * np.outer(scale, scale)) > ALIKE
    out = []
    for i, candidate in enumerate(found):
        others = [c.words for k, c in enumerate(found) if k != i and alike[i, k]]
        out.append(ModelCandidate(**{**candidate.__dict__, "group": tuple(others)}))
    return sorted(out, key=lambda c: -c.gain)

"""Lagrange multiplier tests of what a model leaves out (Rao 1948), without solving anew.

A candidate is a direction in the space of given values or specials. Made orthogonal to all that is
solved for, its information I and score g predict the value -g / I by which it is off and the fall
g^2 / I of the sum of squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtri

from ....records.rig import Rig
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from .extended import Extended, freed, given_blocks
from .residual_images import Correlation, residual_correlation

Floats = NDArray[np.float64]

_SEVERAL = 2
"""Candidates from which on a block is tested as a whole too: one alone is its own test."""
_RANK = 1e-6
"""Eigenvalue of the candidates' correlation below which a direction repeats others."""
_USEFUL = 20.0
"""Deviation from noise alone, in those of careful calibrations, above which a value is not tested:
the data hardly see it, and noise that passes for relief would decide."""
_UNSEEN = 1e-8
"""Share of a candidate's own information that must be left beside the unknowns."""


@dataclass(frozen=True, eq=False)
class Testable:
    """One thing that can be tested."""

    key: str
    words: str
    unit: str
    block: str | None
    """Whose given value it is; None for what is no block."""
    limit: float
    """Error, in its unit, that no careful calibration makes; only smaller deviations tell."""
    direction: Floats
    """(G,) by one unit of it."""
    step: Floats | None = None
    """(width,) of the block's value by one unit, where it is one."""


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
    shift: Floats | None = None
    """(G,) by how much the fit's unknowns would move with it."""
    share: float = 0.0
    """Part of the residuals' structure that it explains."""
    group: tuple[tuple[str, str], ...] = ()
    """Keys and words of others that explain as much, as far as the data tell."""

    @property
    def deviations(self) -> float:
        return abs(self.value) / self.std


@dataclass(frozen=True, eq=False)
class Tests:
    """All candidates, the most explaining first."""

    candidates: list[ModelCandidate]
    blocks: list[ModelCandidate]
    """Blocks with several parts, all of them together."""
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
    noise: float
    """Variance of one whitened coordinate, times the design effect of what is left."""


def score_tests(extended: Extended, rig: Rig, variance: float) -> Tests:
    """Test every candidate that the data can tell something of.

    Args:
        extended: the fit with the candidates' columns.
        rig: of the fit.
        variance: of one whitened coordinate.
    """
    named = candidates(extended, rig)
    columns = np.array([c.direction for c in named]).T
    W, information, score = extended.directions(columns)
    own = np.einsum("gk,gh,hk->k", columns, extended.S, columns)
    observable = np.diag(information) > _UNSEEN * own
    observable &= np.diag(information) > variance / np.array([c.limit for c in named]) ** 2
    named = [n for n, is_observable in zip(named, observable, strict=True) if is_observable]
    W, information, score = (
        W[:, observable],
        information[np.ix_(observable, observable)],
        score[observable],
    )
    # Together, values may have directions that the data hardly see although they see each.
    limits = np.array([c.limit for c in named])
    information = information + np.diag(variance / limits**2)
    step, rank = _joint(information, score)
    gain = float(-score @ step)
    before = residual_correlation(extended.result)
    after = residual_correlation(extended.result, _after(extended, W @ step))
    noise = variance * after.effect.largest
    energy = _energy(extended.result)
    structured = max(before.structure.excess * energy, 1e-300)
    tested = [
        ModelCandidate(
            c.key, c.words, c.unit, c.block, float(-g / i), float(np.sqrt(noise / i)),
            float(g * g / i), -g / i * w[extended.solved], min(float(g * g / i / structured), 1.0),
        )
        for c, g, i, w in zip(named, score, np.diag(information), W.T, strict=True)
    ]  # fmt: skip
    chance = float(chdtrc(max(rank, 1), max(gain, 0.0) / noise))
    blocks = _blocks(tested, information, score, W[extended.solved], structured, noise)
    tested.sort(key=lambda c: -c.gain)
    return Tests(tested, blocks, before, after, energy, gain, chance, noise)


def _after(extended: Extended, step: Floats) -> list[Floats]:
    """Return the residuals (2, N) of every frame after a step (G,), to first order."""
    return [
        at.residual + np.where(at.hits, extended.derivatives(k, step[:, None])[:, 0], 0.0)
        for k, at in enumerate(extended.result.evaluation.frames)
    ]


def _energy(result: OptimisationResult) -> float:
    """Return the weighted sum of squared residuals."""
    return sum(
        float((w * at.squared)[at.hits].sum())
        for w, at in zip(result.weights, result.evaluation.frames, strict=True)
    )


def candidates(extended: Extended, rig: Rig) -> list[Testable]:
    """Return everything that can be tested."""
    layout, size = extended.layout, len(extended.g)
    out: list[Testable] = []
    rig = freed(rig, given_blocks(extended.result.problem.layout))
    for name in given_blocks(extended.result.problem.layout):
        root = BLOCKS[name].doubt(rig, layout.given[name])
        for owner in sorted(set(layout.owners[name])):
            if (name, owner) not in layout.slots:
                continue
            T = layout.tangent_map(extended.state, name, owner)
            for suspect in BLOCKS[name].suspects(layout.names[name]):
                direction = np.zeros(size)
                direction[layout.slots[name, owner]] = T.T @ suspect.step
                key = f"{name}.{suspect.part}" if suspect.part else name
                limit = np.inf if root is None else _USEFUL / np.linalg.norm(root @ suspect.step)
                out.append(Testable(
                    key, suspect.words, suspect.unit, name, float(limit), direction, suspect.step
                ))  # fmt: skip
    for i, special in enumerate(extended.specials):
        direction = np.zeros(size)
        direction[layout.columns + i] = 1.0
        out.append(
            Testable(special.key, special.words, special.unit, None, special.limit, direction)
        )
    return out


def _blocks(
    tested: Sequence[ModelCandidate], information: Floats, score: Floats, W: Floats,
    structured: float, noise: float,
) -> list[ModelCandidate]:  # fmt: skip
    """Return every block of several candidates as one."""
    out = []
    for name in dict.fromkeys(c.block for c in tested if c.block is not None):
        at = [i for i, c in enumerate(tested) if c.block == name]
        if len(at) < _SEVERAL:
            continue
        step, rank = _joint(information[np.ix_(at, at)], score[at])
        gain = float(-score[at] @ step)
        share = min(gain / structured, 1.0)
        deviations = -ndtri(max(chdtrc(rank, max(gain, 0.0) / noise), 1e-300) / 2)
        out.append(ModelCandidate(
            name, BLOCKS[name].words, "", name, float(deviations), 1.0, gain, W[:, at] @ step, share
        ))  # fmt: skip
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

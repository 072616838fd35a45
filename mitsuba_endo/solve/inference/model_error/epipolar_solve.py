"""Minimising a fit's epipolar residuals on a sample of pixels, with given values free or not.

Surfaces are eliminated exactly (:mod:`.epipolar_fit`), so that a few dozen milliseconds do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....records.rig import Rig
from ....robust import robust_std
from ...costs.coordinate_residual import Observations
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from ...unknowns.state import State
from .epipolar_fit import EpipolarFrame, along, derivatives, epipolar_frame, thinned
from .extended import freed, given_blocks

Floats = NDArray[np.float64]

_TRIES = 4
"""Dampings tried for a step before a refit ends where it is. Chosen."""
_SETTLED = 1e-3
"""Relative fall of the cost at which a refit ends."""
_SETTLED_NOISE = 0.99
"""A noise that falls to no less than this share of itself in a step has settled. Chosen."""
_DAMPING = (1e-4, 10.0, 0.1)
"""First one, and the factors after a failed and a successful step."""
_CAUCHY = 2.5
"""Scale of the robust loss in noise standard deviations."""
_FAR = 100.0
"""Deviations that count for a pixel without a residual."""


@dataclass(frozen=True, eq=False)
class ModelVariant:
    """One thing to free: directions of given values, or another projection model."""

    key: str
    law: str
    steps: Sequence[tuple[str, Floats]] = ()
    """(block, step of its value by one unit of the candidate)."""
    layout: Layout | None = None
    """Another plan of sharing; None for that of the fit."""


@dataclass(frozen=True, eq=False)
class EpipolarSample:
    """What a refit looks at: a part of every frame's pixels."""

    layout: Layout
    observed: Sequence[Observations]
    given: dict[str, Floats]


@dataclass(frozen=True, eq=False)
class Point:
    """Where a refit stands."""

    state: State
    amounts: Floats
    """(K,) of the directions that are free."""
    frames: list[EpipolarFrame]

    @property
    def r(self) -> Floats:
        """(N,) residuals of all frames."""
        return np.concatenate([at.r for at in self.frames])


def sampled(result: OptimisationResult, rig: Rig, pixels: int) -> EpipolarSample:
    """Return about so many pixels of a fit's frames together."""
    problem, layout = result.problem, result.problem.layout
    wide = make_layout(freed(rig, given_blocks(layout)), layout.frames)
    stride = max(1, round(np.sqrt(problem.observations / pixels)))
    given = {name: value for name, value in wide.given.items() if value is not None}
    return EpipolarSample(layout, [thinned(o, stride) for o in problem.observed], given)


def solved(sample: EpipolarSample, variant: ModelVariant, now: Point, iterations: int) -> Point:
    """Minimise by Levenberg-Marquardt on reweighted least squares, the scale falling along."""
    mu, up, down = _DAMPING
    sigma = noise_of(now.r)
    for _ in range(iterations):
        J, r, cost = (
            _jacobian(sample, variant, now),
            np.nan_to_num(now.r),
            robust_cost(now.r, sigma),
        )
        w = np.where(np.isfinite(now.r), 1 / (1 + (r / (_CAUCHY * sigma)) ** 2), 0.0)
        H, g = (J * w) @ J.T, (J * w) @ r
        for _ in range(_TRIES):
            trial = _moved(sample, variant, now, _damped(H, g, mu))
            gained = cost - robust_cost(trial.r, sigma)
            if gained >= 0:
                break
            mu *= up
        else:
            break
        mu, now = mu * down, trial
        followed = min(sigma, noise_of(now.r))
        if gained < _SETTLED * cost and followed > _SETTLED_NOISE * sigma:
            break
        sigma = followed
    return now


def _damped(H: Floats, g: Floats, mu: float) -> Floats:
    scale = 1 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    A = H * np.outer(scale, scale) + mu * np.eye(len(g))
    return -scale * np.linalg.lstsq(A, scale * g, rcond=1e-12)[0]


def point_at(
    sample: EpipolarSample, variant: ModelVariant, state: State, amounts: Floats | None = None,
    last: Sequence[EpipolarFrame | None] = (),
) -> Point:  # fmt: skip
    """Return a point at a state with the variant's values moved by ``amounts``."""
    amounts = np.zeros(len(variant.steps)) if amounts is None else amounts
    given = {name: sample.given[name] for name, _ in variant.steps}
    for (name, step), amount in zip(variant.steps, amounts, strict=True):
        given[name] = BLOCKS[name].retract(given[name], amount * step)
    values = {name: (value,) * len(state.values[name]) for name, value in given.items()}
    state = replace(state, values={**state.values, **values})
    last = last or [None] * sample.layout.frames
    frames = [
        epipolar_frame(o, variant.law, state, k, last[k]) for k, o in enumerate(sample.observed)
    ]
    return Point(state, amounts, frames)


def _moved(sample: EpipolarSample, variant: ModelVariant, now: Point, step: Floats) -> Point:
    layout = variant.layout or sample.layout
    size = layout.columns
    state = layout.retract(now.state, step[:size])
    return point_at(sample, variant, state, now.amounts + step[size:], now.frames)


def _jacobian(sample: EpipolarSample, variant: ModelVariant, at: Point) -> Floats:
    """Return the derivatives (G + K, N), zero where there is no residual."""
    parts, layout = [], variant.layout or sample.layout
    for k, (observed, now) in enumerate(zip(sample.observed, at.frames, strict=True)):
        own = derivatives(observed, variant.law, at.state, layout, k, now)
        further = [along(observed, variant.law, at.state, k, now, *step) for step in variant.steps]
        parts.append(np.concatenate([own, np.reshape(further, (-1, len(now.r)))]))
    return np.nan_to_num(np.concatenate(parts, 1))


def noise_of(r: Floats) -> float:
    """Return the standard deviation of residuals, pattern pixels; NaN = none there."""
    return max(robust_std(r[~np.isnan(r)]), 1e-6)


def robust_cost(r: Floats, sigma: float) -> float:
    """Return the robust cost, noise variances."""
    with np.errstate(over="ignore"):  # a step that went too far costs infinitely much
        square = np.where(np.isfinite(r), (r / sigma) ** 2, _FAR**2)
    return float(_CAUCHY**2 / 2 * np.log1p(square / _CAUCHY**2).sum())

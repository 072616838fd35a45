"""What errors of the given values do to the estimates.

A fit holds what was given. With unknowns x, given values n and the information A of the data about
n (made orthogonal to x and to the surfaces), an error d of n moves the estimate of x by S d, with
S = H_xx^-1 H_xn. Under the prior d ~ N(0, P) the data leave d with the covariance
Q = (P^-1 + A)^-1 and the mean m = Q u, u being the score; so the best estimate is x + S m with the
covariance C + S Q S^T, where C is the covariance with n known, and x itself has the mean square
error C + S (Q + m m^T) S^T. Its mean over maps is C + S P S^T (law of total variance).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....records.rig import Rig
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from .extended import Extended, freed, given_blocks

Floats = NDArray[np.float64]

_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""By which a prior may be widened; more would hold nothing."""
_CHANGES, _LEAST_GAIN = 8, 1.0
"""Times that a prior is widened, each for so much log-likelihood at least."""


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What is not known of the given values, and what it does to a fit."""

    blocks: tuple[str, ...]
    covariance: Floats
    """(G, G) Q of the fit's unknowns, S Q S^T."""
    shift: Floats
    """(G,) S m: by how much the unknowns are off, as far as the data tell."""
    surface_roots: list[Floats]
    """(V, K) of every surface's values: products are the covariances that come of it."""
    surface_shifts: list[Floats]
    """(V,) by how much every surface's values are off, likewise."""
    step: Floats
    """(G,) W m of unknowns and given values together."""
    roots: dict[str, Floats]
    """Square-root information (m, width) of the priors that were used, against data with the
    design effect that was used."""


def doubtful(rig: Rig, layout: Layout, stated: bool) -> dict[str, Floats]:
    """Return the square-root information of the given blocks that careful work gets wrong.

    Args:
        rig: whose deviations replace the defaults.
        layout: of the fit.
        stated: only what the rig itself gives a deviation for.
    """
    names = given_blocks(layout)
    rig = freed(rig, names)
    given = make_layout(rig, layout.frames).given
    if stated:
        names = [n for n in names if BLOCKS[n].prior_std(rig, given[n]) is not None]
    roots = {name: BLOCKS[name].doubt(rig, given[name]) for name in names}
    return {name: root for name, root in roots.items() if root is not None}


def nuisance(
    extended: Extended, roots: Mapping[str, Floats], noise: float, *, widen: bool
) -> Nuisance:
    """Return what uncertain given values do to a fit.

    Args:
        extended: its normal equations with the given values' columns.
        roots: square-root information (m, width) of the blocks in doubt.
        noise: variance of one whitened coordinate, times the design effect.
        widen: whether priors that the data contradict become wider.
    """
    steps = _prior_steps(extended, roots)
    W, A, score = extended.directions(steps)
    A, u = A / noise, -score / noise
    wider = _widening(A, u) if widen else np.ones(len(u))
    W, A, u = W * wider, A * np.outer(wider, wider), u * wider
    Q = np.linalg.inv(np.eye(len(u)) + A)
    values, vectors = np.linalg.eigh(Q)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    own, mean = W[extended.solved], Q @ u
    return Nuisance(
        tuple(roots), (own @ Q) @ own.T, own @ mean,
        [X @ (W @ root) for X in extended.responses],
        [-(X @ (W @ mean)) for X in extended.responses],  # surfaces give way: the step is -A^-1 B
        W @ mean, _widened_roots(extended, roots, wider),
    )  # fmt: skip


def _widened_roots(
    extended: Extended, roots: Mapping[str, Floats], wider: Floats
) -> dict[str, Floats]:
    """Return the priors' square roots with their deviations multiplied, in the steps' order."""
    out, first = {}, 0
    for name, _ in extended.layout.slots:
        if name in roots:
            size = len(roots[name])
            out[name] = roots[name] / wider[first : first + size, None]
            first += size
    return out


def _prior_steps(extended: Extended, roots: Mapping[str, Floats]) -> Floats:
    """Return the directions (G, K) of one standard deviation each."""
    inverse = {name: np.linalg.inv(root) for name, root in roots.items()}
    eye = np.eye(len(extended.g))
    columns = [
        eye[:, slot] @ inverse[name]
        for (name, _), slot in extended.layout.slots.items()
        if name in roots
    ]
    return np.concatenate(columns, 1) if columns else eye[:, :0]


def _widening(A: Floats, u: Floats) -> Floats:
    """Return the factor of every prior; the one that gains most is changed first.

    In standard deviations of the priors the scores u have the variance A of noise and, with priors
    widened by L, A L^2 A: each factor is that of the largest marginal likelihood (automatic
    relevance determination, MacKay 1994). A value given by mistake is off by more than careful
    work gets wrong; the others keep their prior.
    """
    factors = np.ones(len(u))
    for _ in range(_CHANGES):
        tried = [
            np.where(np.arange(len(u)) == i, f, factors) for i in range(len(u)) for f in _FACTORS
        ]
        if not tried:
            break
        best = max(tried, key=lambda L: _evidence(A, u, L))
        if _evidence(A, u, best) < _evidence(A, u, factors) + _LEAST_GAIN:
            break
        factors = best
    return factors


def _evidence(A: Floats, u: Floats, L: Floats) -> float:
    """Return the logarithm of the marginal likelihood, up to a constant."""
    wide = np.eye(len(u)) + A * np.outer(L, L)
    return 0.5 * float((L * u) @ np.linalg.solve(wide, L * u) - np.linalg.slogdet(wide)[1])

"""The sandwich covariance I^-1 V I^-1: what the observations alone say about the global unknowns.

The Schur complement at the optimum holds two things that look like information and are none. The
prior on the surface resists any deformation, also one that the data leave free (a pinhole
projector with a free centre). And the surface found is bumpy with noise: a plane, which does not
show the focal length of a pinhole projector, seems to have the relief that would.
"""

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ..costs.objective import evaluate
from ..costs.term import ResidualTerm
from ..elimination.normal_equations import NormalEquations, surface_rows
from ..elimination.schur_complement import Reduced, SurfaceBlock
from ..minimisers.result import OptimisationResult
from ..unknowns.state import State
from .observability import problem_unknowns

_PRIOR = 1e-4
"""Part of the prior that is kept, to hold vertices that no frame sees."""
_DOUBTFUL = 0.0025
"""Standard deviation, in natural scales, from which on noise is checked for false information."""
_DRAWS = 4
"""Simulations of the noise, of which the mean is taken."""
_TRUSTED = 0.5
"""Share of the apparent information that must remain; else the noise outweighs the data."""
_NOTHING = 1e-4
"""Share that is left to a direction without information, so that numbers stay finite."""
_MOST_EXCESS = 100.0
"""Largest ratio of a score's variance to the information, likewise."""


@dataclass(frozen=True, eq=False)
class Information:
    """What the data tell about the global unknowns, in noise variances."""

    information: NDArray[np.float64]
    """(G, G) information I of the data."""
    score: NDArray[np.float64]
    """(G, G) variance V of the score of the calibration. Noise on its surface that passes for
    relief multiplies noise of the residuals: V is I and what that adds."""

    def covariance(self) -> NDArray[np.float64]:
        """Return I^-1 V I^-1 (G, G), V taken to be at least I and finite.

        The covariance of an estimator that solves a score equation (Huber 1967).
        """
        inverse = inverse_information(self.information)
        if self.score is self.information or not len(inverse):
            return inverse
        scale = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
        values, vectors = np.linalg.eigh(inverse / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        excess, turn = np.linalg.eigh(root.T @ self.score @ root)
        turned = root @ turn
        return (turned * np.clip(excess, 1.0, _MOST_EXCESS)) @ turned.T


def inverse_information(S: NDArray[np.float64]) -> NDArray[np.float64]:
    """Invert after scaling; directions without information get a huge variance, not infinity."""
    if not len(S):
        return S
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    values, vectors = np.linalg.eigh(S * np.outer(scale, scale))
    values = np.maximum(values, 1e-14 * values[-1])
    return np.outer(scale, scale) * ((vectors / values) @ vectors.T)


def data_information(
    result: OptimisationResult,
    smooth: OptimisationResult,
    normal: NormalEquations,
    reduced: Reduced,
    variance: float,
) -> Information:
    """Return the information about the global unknowns, in noise variances.

    The surface is free: its prior counts for next to nothing. Where some direction is not known
    well, noise is added once more to the surface by simulation, and what that adds to the
    information is subtracted (simulation extrapolation, Cook and Stefanski 1994).

    Args:
        result: the calibration.
        smooth: the same with its surface smoothed, where the information is taken.
        normal: the normal equations of ``smooth``.
        reduced: the same, reduced.
        variance: of one coordinate, pattern pixels squared.
    """
    S, of_priors = _information(smooth, smooth.state, normal), _priors(smooth)
    scale = np.array([u.scale for u in problem_unknowns(smooth.problem, smooth.state)])
    weakest = scipy.linalg.eigvalsh(S * np.outer(scale, scale))[:1]
    if not len(S) or weakest[0] * _DOUBTFUL**2 > variance:
        return Information(S, S)
    rng = np.random.default_rng(0)
    noisy = []
    for _ in range(_DRAWS):
        state = _with_more_noise(smooth, reduced, np.sqrt(variance), rng)
        at = evaluate(smooth.problem, state)
        again = at.normal_equations(smooth.noise, smooth.weights)
        noisy.append(_information(smooth, state, again))
    return Information(
        without_false_information(S - of_priors, np.mean(noisy, axis=0) - of_priors) + of_priors,
        _information(result, result.state, result.normal_equations()),
    )


def _priors(result: OptimisationResult) -> NDArray[np.float64]:
    """Return the information (G, G) of terms over the unknowns alone, which noise does not fake."""
    normal = NormalEquations.empty(result.problem.surfaces, result.problem.layout.columns)
    for term in result.problem.others:
        if isinstance(term, ResidualTerm):
            term.accumulate(normal, result.state, result.noise)
    return normal.D


def without_false_information(
    S: NDArray[np.float64], noisy: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Extrapolate information (G, G) from noise once (S) and twice (noisy) to none.

    Directions in which less than half of S remains keep next to nothing.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    outer = np.outer(scale, scale)
    base = S * outer + 1e-12 * np.eye(len(S))
    share, V = scipy.linalg.eigh((2 * S - noisy) * outer, base)
    share = np.where(share > _TRUSTED, np.minimum(share, 1.0), _NOTHING)
    W = base @ V
    return (W * share) @ W.T / outer


def _information(
    result: OptimisationResult, state: State, normal: NormalEquations
) -> NDArray[np.float64]:
    """Reduce normal equations with hardly any of what holds surfaces without telling anything."""
    regularisers = [t for t in result.problem.smoothness if not t.informative]
    blocks = list(normal.surfaces)
    for term in regularisers:
        block = blocks[term.index]
        A = block.A - (1 - _PRIOR) * term.hessian(state, result.noise)
        blocks[term.index] = SurfaceBlock(A.tocsr(), block.B, block.g, block.bandwidth)
    return NormalEquations(blocks, normal.D, normal.g).reduce().S


def _with_more_noise(
    result: OptimisationResult, reduced: Reduced, sigma: float, rng: np.random.Generator
) -> State:
    """Return the state with surfaces that answer to simulated noise of ``sigma`` pattern pixels."""
    response = [np.zeros_like(values) for values in result.state.surfaces]
    for k, lin in enumerate(result.evaluation.linearisations()):
        root = np.sqrt(result.weights[k])
        noise = sigma * rng.standard_normal(2 * len(root)) * np.tile(root, 2)
        s = result.problem.layout.surface_of[k]
        response[s] += surface_rows(lin, root, len(response[s])).T @ noise
    moved = [
        values + factor.solve(g)
        for values, factor, g in zip(result.state.surfaces, reduced.factors, response, strict=True)
    ]
    return result.state.with_surfaces(*moved)

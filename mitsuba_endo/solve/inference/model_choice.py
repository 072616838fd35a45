"""Which projection model the residuals support, and by how much."""

from typing import Any

import numpy as np

from ...records.solution import Outcome
from ..minimisers.result import OptimisationResult
from .fit import Fit
from .jackknife import image_blocks

MIN_EVIDENCE = 10.0
"""Difference of log-likelihood below which the laws fit alike."""
MIN_SIGNIFICANCE = 3.0
"""Difference over its standard error between image blocks: guards against errors of the model
that are alike over many pixels."""


def choose_law(fits: list[Fit]) -> tuple[Fit, dict[str, Any], list[str]]:
    """Choose among fits of the same maps under different laws.

    The robust costs are compared at one noise level, block by block of the images: the mean
    difference over its standard error says whether the data can tell.

    Returns:
        The chosen fit, the evidence for ``solution.json``, and warnings.
    """
    if len(fits) == 1:
        return fits[0], {}, []
    sigma = min(f.result.noise.sigma for f in fits)
    costs = [_block_costs(f.result, sigma) for f in fits]
    common = sorted(set.intersection(*(set(c) for c in costs)))
    totals = [sum(c[key] for key in common) + _prior(f.result, sigma)
              for c, f in zip(costs, fits, strict=True)]  # fmt: skip
    order = sorted(range(len(fits)), key=lambda i: totals[i])
    best, other = order[0], order[1]
    difference = np.array([costs[other][key] - costs[best][key] for key in common])
    total = float(totals[other] - totals[best])
    error = float(difference.std(ddof=1) * np.sqrt(len(difference))) if len(common) > 1 else np.inf
    significance = total / error if error > 0 else 0.0
    open_ = _may_gain(fits[other])
    decided = total - open_ > max(MIN_EVIDENCE, MIN_SIGNIFICANCE * error)
    name, other_law = fits[best].law, fits[other].law
    how = f"{total:.{0 if decided else 1}f}, {significance:.1f} standard errors"
    text = (
        f"the residuals support {name} over {other_law}: log-likelihood higher by {how}"
        if decided
        else f"the residuals cannot tell {name} from {other_law}: log-likelihood differs by {how}"
    )
    if open_ > 0:
        text += f"; the fit of {other_law} had not converged and may gain about {open_:.0f}"
    if not decided and _settled(fits[other]) and not _settled(fits[best]):
        best = other  # the data allow both, and this one is finished
    evidence = {
        "chosen": fits[best].law,
        "conclusion": text,
        "decided": decided,
        "log_likelihood_difference": total,
        "standard_errors": significance,
        "noise_px": {f.law: f.uncertainty.sigma for f in fits},
        "focal": {f.law: f.result.state.focals[0] for f in fits},
    }
    warning = [] if decided else [f"{text}; give projector.law if it is known"]
    return fits[best], evidence, warning


def cheaper(a: OptimisationResult, b: OptimisationResult) -> bool:
    """Tell whether the first of two results for the same frames and model costs less."""
    sigma = min(a.noise.sigma, b.noise.sigma)
    first, second = (sum(_block_costs(r, sigma).values()) + _prior(r, sigma) for r in (a, b))
    return first < second


def _may_gain(fit: Fit) -> float:
    """Return the log-likelihood that a fit which has not converged may still gain, about.

    That of the step it would make next, times ten: along a valley many more follow.
    """
    if _settled(fit) or not fit.result.trace:
        return 0.0
    return 5.0 * fit.problem.layout.columns * fit.result.trace[-1].step ** 2


def _settled(fit: Fit) -> bool:
    return fit.result.outcome is Outcome.CONVERGED


def _block_costs(result: OptimisationResult, sigma: float) -> dict[tuple[str, int], float]:
    """Return the cost of every image block in noise variances."""
    noise = result.noise.at(sigma)
    out: dict[tuple[str, int], float] = {}
    for term, at in zip(result.problem.frames, result.evaluation.frames, strict=True):
        block = image_blocks(term.observed.pixels)
        for b, value in enumerate(np.bincount(block, term.costs(at, noise)) / sigma**2):
            out[term.observed.name, b] = float(value)
    return out


def _prior(result: OptimisationResult, sigma: float) -> float:
    """Return the cost of everything but the data, in noise variances."""
    noise = result.noise.at(sigma)
    return sum(t.cost(result.state, noise) for t in result.problem.others) / sigma**2

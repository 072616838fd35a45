"""Which projector law the residuals support, and by how much."""

from typing import Any

import numpy as np

from ...records.solution import Outcome
from ..cost.objective import MISSED
from ..fit import Fit
from ..optimise.optimum import Optimum
from ..statistics.uncertainty import image_blocks

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
    sigma = min(f.optimum.objective.sigma for f in fits)
    costs = [_block_costs(f.optimum, sigma) for f in fits]
    common = sorted(set.intersection(*(set(c) for c in costs)))
    totals = [sum(c[key] for key in common) + _prior(f.optimum, sigma)
              for c, f in zip(costs, fits, strict=True)]  # fmt: skip
    order = sorted(range(len(fits)), key=lambda i: totals[i])
    best, other = order[0], order[1]
    difference = np.array([costs[other][key] - costs[best][key] for key in common])
    total = float(totals[other] - totals[best])
    error = float(difference.std(ddof=1) * np.sqrt(len(difference))) if len(common) > 1 else np.inf
    significance = total / error if error > 0 else 0.0
    open_ = _may_gain(fits[other])
    decided = total - open_ > max(MIN_EVIDENCE, MIN_SIGNIFICANCE * error)
    name, rival = fits[best].law, fits[other].law
    how = f"{total:.{0 if decided else 1}f}, {significance:.1f} standard errors"
    text = (
        f"the residuals support {name} over {rival}: log-likelihood higher by {how}"
        if decided
        else f"the residuals cannot tell {name} from {rival}: log-likelihood differs by {how}"
    )
    if open_ > 0:
        text += f"; the fit of {rival} had not converged and may gain about {open_:.0f}"
    if not decided and _settled(fits[other]) and not _settled(fits[best]):
        best = other  # the data allow both, and this one is finished
    evidence = {
        "chosen": fits[best].law,
        "conclusion": text,
        "decided": decided,
        "log_likelihood_difference": total,
        "standard_errors": significance,
        "noise_px": {f.law: f.uncertainty.sigma for f in fits},
        "focal": {f.law: float(np.exp(f.optimum.state.intrinsics[0][0])) for f in fits},
    }
    warning = [] if decided else [f"{text}; give projector.law if it is known"]
    return fits[best], evidence, warning


def cheaper(a: Optimum, b: Optimum) -> bool:
    """Tell whether the first of two optima of the same frames under one law costs less."""
    sigma = min(a.objective.sigma, b.objective.sigma)
    first, second = (sum(_block_costs(o, sigma).values()) + _prior(o, sigma) for o in (a, b))
    return first < second


def _may_gain(fit: Fit) -> float:
    """Return the log-likelihood that a fit which has not converged may still gain, about.

    That of the step it would make next, times ten: along a valley many more follow.
    """
    if _settled(fit) or not fit.optimum.trace:
        return 0.0
    return 5.0 * fit.problem.plan.columns * fit.optimum.trace[-1].step ** 2


def _settled(fit: Fit) -> bool:
    return fit.optimum.outcome is Outcome.CONVERGED


def _block_costs(optimum: Optimum, sigma: float) -> dict[tuple[str, int], float]:
    """Return the cost of every image block in noise variances."""
    loss = optimum.objective.loss
    scale = loss.efficient_scale * sigma
    out: dict[tuple[str, int], float] = {}
    for k, frame in enumerate(optimum.objective.problem.frames):
        r2 = optimum.evaluation.squared(k)
        missed = loss(np.array((MISSED * scale) ** 2), scale)
        cost = np.where(np.isfinite(r2), loss(np.nan_to_num(r2), scale), missed)
        block = image_blocks(frame.pixels, frame.shape)
        for b, value in enumerate(np.bincount(block, cost) / sigma**2):
            out[frame.name, b] = float(value)
    return out


def _prior(optimum: Optimum, sigma: float) -> float:
    surfaces = optimum.objective.problem.surfaces
    total = sum(
        s.prior.cost(rho, sigma) for s, rho in zip(surfaces, optimum.state.rho, strict=True)
    )
    return total / sigma**2

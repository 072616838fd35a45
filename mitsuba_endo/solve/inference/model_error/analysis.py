"""Whether a model explains the residuals, and what its errors do to the intervals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ....records.rig import Rig
from ....records.solution import Outcome
from ...costs.doubt import DoubtTerm
from ...costs.loss import NoiseScale
from ...costs.problem import evaluate
from ...costs.term import ResidualTerm
from ...minimisers.levenberg_marquardt import LevenbergMarquardt
from ...minimisers.result import OptimisationResult
from ...options import Options
from ...unknowns.block import BLOCKS, Floats
from ...unknowns.layout import Layout, make_layout
from ..information import inverse_information
from .extended import Extended, extend, freed, given_blocks, over, widened
from .plan import PlanTest, plan_tests
from .residual_images import Correlation, residual_correlation
from .score_tests import ModelCandidate, Tests, score_tests
from .special import specials_of

FALSE_ALARMS = 0.002
"""Probability with which the tests of all candidates together may accuse a right model."""
STRUCTURED = 4.0
"""Standard deviations by which the structure of white noise must be exceeded. That of right models
lies below it: the surface follows what is smooth."""
_UNEXPLAINED = 0.25
"""Share of the residuals' energy that is structure from which on nothing counts as measured."""
BEYOND = 2.0
"""Factor of a design effect above one: errors alike over the whole image are seen by no block. On
five real captures, whose effect is 430 to 830, two left the focal length's error at 0.1 to 0.9
stated deviations and the pose's at up to 2.6."""
_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""By which a prior may be widened; more would hold nothing."""
_CHANGES, _LEAST_GAIN = 8, 1.0
"""Times that a prior is widened, each for so much log-likelihood at least."""
_LENGTHS, _WORSE = (1.0, 0.5, 0.25, 0.0), 1.1
"""Shares of a step that are tried, until the residuals are not larger by more than this."""
_SETTLES = 8
"""Iterations after which what is carried has settled where noise is all that is left."""


@dataclass(frozen=True, eq=False)
class ModelCheck:
    """What the residuals say of the model."""

    tests: Tests
    plan: list[PlanTest]
    """Of values that frames share and that each might have for itself."""
    carried: tuple[str, ...]
    """Given blocks that became unknowns, each held by how well it is usually known."""
    effect: float
    """By which the information of independent pixels is divided."""
    final: Correlation
    """Of the residuals with what is carried."""
    understated: float = 1.0
    """Noise over that of the residuals, which are smaller as the surface follows them."""

    @property
    def wrong(self) -> bool:
        """Whether the residuals hold more than noise, or accuse a candidate."""
        return _structured(self.tests.before) or bool(self.accused) or bool(self.refuted_plan)

    @property
    def accused(self) -> list[ModelCandidate]:
        """The candidates that noise does not explain, the most explaining first."""
        found = self.tests.candidates
        limit = norm.isf(FALSE_ALARMS / 2 / max(len(found), 1))
        return [c for c in found if c.deviations > limit * self.understated]

    @property
    def refuted_plan(self) -> list[PlanTest]:
        return [p for p in self.plan if p.chance < FALSE_ALARMS / max(len(self.plan), 1)]

    @property
    def unexplained(self) -> bool:
        """Whether so much structure is left that no interval can be relied on."""
        return self.wrong and self.final.structure.excess > _UNEXPLAINED

    def share(self, gain: float) -> float:
        """Return the part of the structure that a fall of the squared residuals explains."""
        structured = self.tests.before.structure.excess * self.tests.energy
        return float(np.clip(gain / max(structured, gain, 1e-300), 0.0, 1.0))


def check_model(
    result: OptimisationResult, rig: Rig, options: Options
) -> tuple[OptimisationResult, ModelCheck]:
    """Test the model of a fit, and carry its errors where it does not hold.

    Returns:
        The fit, with given blocks as unknowns where noise does not explain the residuals, and what
        was found.
    """
    variance = result.noise.sigma**2
    extended = extend(result, rig, specials_of(result.problem.law))
    tests = score_tests(extended, variance)
    plan = plan_tests(result, rig, variance * tests.after.effect.largest)
    check = ModelCheck(tests, plan, (), tests.before.effect.largest, tests.before)
    roots = doubtful(rig, result.problem.layout)
    sound = not _structured(tests.before) and not check.refuted_plan
    if sound or not roots or result.outcome is not Outcome.CONVERGED:
        return result, replace(check, effect=_beyond(check.effect))
    white = not _structured(tests.after) and tests.after.effect.largest <= 1
    effect = 1.0 if white else _beyond(tests.before.effect.largest)
    if white:
        roots = loosened(extended, roots, variance)
    carried = carry(extended, rig, options, roots, effect)
    final = residual_correlation(carried)
    return carried, replace(check, carried=tuple(roots), effect=effect, final=final)


def with_effect(result: OptimisationResult, formal: Floats, effect: float) -> Floats:
    """Return the covariance (G, G) with the information of the data, not of priors, divided.

    Args:
        result: the fit.
        formal: (G, G) covariance that counts pixels as independent.
        effect: design effect.
    """
    terms = [t for t in result.problem.others if isinstance(t, ResidualTerm)]
    known = [t.jacobian(result.state) for t in terms if not isinstance(t, DoubtTerm)]
    if effect <= 1 or not known:
        return effect * formal
    priors = sum(J.T @ J for J in known)
    return inverse_information(inverse_information(formal) / effect + (1 - 1 / effect) * priors)


def _structured(found: Correlation) -> bool:
    return found.structure.deviations > STRUCTURED


def _beyond(effect: float) -> float:
    return 1 + BEYOND * (effect - 1)


def doubtful(rig: Rig, layout: Layout) -> dict[str, Floats]:
    """Return the square-root information of every given block that careful work gets wrong."""
    names = given_blocks(layout)
    wide = make_layout(freed(rig, names), layout.frames)
    roots = {name: BLOCKS[name].doubt(rig, wide.given[name]) for name in names}
    return {name: root for name, root in roots.items() if root is not None}


def loosened(extended: Extended, roots: dict[str, Floats], noise: float) -> dict[str, Floats]:
    """Return the priors, each widened by as much as the data need to be likely under it.

    In standard deviations of the priors, the scores u of the given values have the variance A of
    noise and, with priors widened by L, A L^2 A: each factor is that of the largest marginal
    likelihood (automatic relevance determination, MacKay 1994). A value given by mistake is off by
    more than careful work gets wrong; the others keep their prior.
    """
    inverse = {name: np.linalg.inv(root) for name, root in roots.items()}
    columns = [
        np.eye(len(extended.g))[:, slot] @ inverse[name]
        for (name, _), slot in extended.layout.slots.items()
        if name in roots
    ]
    _, information, score = extended.directions(np.concatenate(columns, 1))
    wider = iter(_widening(information / noise, score / noise))
    return {name: root / [[next(wider)] for _ in root] for name, root in roots.items()}


def _widening(A: Floats, u: Floats) -> Floats:
    """Return the factor of every prior; the one that gains most is changed first."""
    factors = np.ones(len(u))
    for _ in range(_CHANGES):
        tried = [
            np.where(np.arange(len(u)) == i, f, factors) for i in range(len(u)) for f in _FACTORS
        ]
        best = max(tried, key=lambda L: _evidence(A, u, L))
        if _evidence(A, u, best) < _evidence(A, u, factors) + _LEAST_GAIN:
            break
        factors = best
    return factors


def _evidence(A: Floats, u: Floats, L: Floats) -> float:
    """Return the logarithm of the marginal likelihood, up to a constant."""
    wide = np.eye(len(u)) + A * np.outer(L, L)
    return 0.5 * float((L * u) @ np.linalg.solve(wide, L * u) - np.linalg.slogdet(wide)[1])


def carry(
    extended: Extended, rig: Rig, options: Options, roots: dict[str, Floats], effect: float
) -> OptimisationResult:
    """Return the fit with given blocks as unknowns, each under its prior.

    The data count for 1 / ``effect`` of what independent pixels would, so the priors weigh as much
    more relative to them. One step to first order; where noise is all that is left, to the end.
    """
    result = extended.result
    layout = make_layout(freed(rig, list(roots)), result.problem.layout.frames)
    state = widened(result.state, result.problem.layout, layout)
    weighed = {name: np.sqrt(effect) * root for name, root in roots.items()}
    doubt = DoubtTerm(layout, {n: layout.given[n] for n in roots}, weighed)
    others = [over(term, layout) for term in result.problem.others]
    problem = result.problem.with_layout(layout, *others, doubt)
    last = NoiseScale(result.noise.sigma, result.noise.last_loss, last=True)
    step, columns = _step(extended, layout, doubt.jacobian(state), result.noise.sigma)
    responses = [X[:, columns] for X in extended.responses]
    at = evaluate(problem, state)
    for length in _LENGTHS:
        moved = [-length * (X @ step) for X in responses]
        at = evaluate(problem, problem.retract(state, moved, length * step))
        if at.noise() < _WORSE * result.noise.sigma:
            break
    if effect <= 1:
        settled = LevenbergMarquardt(options.tolerance, _SETTLES).run(problem, at.state, last)
        return replace(settled, outcome=result.outcome, trace=result.trace)
    held = problem.with_layout(layout.held(), *problem.smoothness)
    surfaces = LevenbergMarquardt(options.tolerance, 2).run(held, at.state, last).state.surfaces
    at = evaluate(problem, at.state.with_surfaces(*surfaces))
    return OptimisationResult(result.outcome, at, result.noise, result.trace)


def _step(
    extended: Extended, layout: Layout, J: Floats, sigma: float
) -> tuple[Floats, NDArray[np.intp]]:
    """Return the Newton step over a layout's columns, and where the extended system has them."""
    parts: Sequence[NDArray[np.intp]] = [
        np.arange(extended.layout.slots[key].start, extended.layout.slots[key].stop)
        for key in layout.slots
    ]
    columns = np.concatenate(parts)
    S = extended.S[np.ix_(columns, columns)] + sigma**2 * J.T @ J
    return -inverse_information(S) @ extended.g[columns], columns

"""Whether a model explains the residuals, and what its errors do to the intervals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from ....records.rig import Rig
from ....records.solution import Outcome
from ...costs.term import ResidualTerm
from ...minimisers.result import OptimisationResult
from ...unknowns.block import Floats
from ..sandwich_covariance import inverse_information
from .candidates import GROSS, ModelCandidate, Named, named
from .correction import Correction, correction
from .extended import Extended, extend
from .nuisance import Nuisance, doubtful, nuisance
from .refits import PIXELS, Refit, refits, worth_trying
from .residual_images import Correlation
from .score_tests import Tests, score_tests
from .sharing_tests import PlanTest, plan_tests
from .special import specials_of
from .unchecked import Unchecked, unchecked

FALSE_ALARMS = 0.002
"""Probability with which the tests of all candidates together may accuse a right model."""
STRUCTURED = 4.0
"""Standard deviations by which the structure of white noise must be exceeded. That of right models
lies below it: the surface follows what is smooth."""
_FALLS = 3.2
"""The same by which all candidates together lower structure. A surface follows what is smooth, so
structure may lie below that of white noise and be there. Of 140 right models it fell by 2.9 at
most, of 129 wrong ones by 3.1 at least. The joint gain does not tell: noise passes for relief."""
_ACCUSED, _FALLS_FOR_IT = 3.9, 2.0
"""Deviations by which a single value is accused though structure falls by little: some 16 are
tested, and noise alone would accuse in one of 600 maps. It must fall a little, since noise passes
for relief that would show a value; of 140 right models 9 fell so far, and none was off by 3.5."""
_UNEXPLAINED = 0.25
"""Share of the residuals' energy that is structure from which on nothing counts as measured."""
_FAR = 0.1
"""The same from which on refits begin far from the fit too: gross errors lead it astray."""
_DECIDES, _MOST_PIXELS = 8 * GROSS, 7000
"""Gain, noise variances, that a sample must promise for refits to name the cause, and pixels that
it has at most. Chosen: a refit's gain is a robust cost's, and that of one candidate of all."""
_EXPLAINED = 0.9
"""Share of the residuals' energy that a refit must take away to explain them."""
_MOST = 0.5
"""Share of the structure of decoded maps that the candidates must take away to be suspected:
chosen; on twelve photographs, whose rigs were right, they took less."""
_PLAN_EXPLAINS = 0.75
"""Share of the structure that a plan must explain to be blamed. Of four draws of a projector that
moves it explained 0.92 to 1, of five real captures of one that does not, half."""
_CORRECTION_STD = 0.5
"""Standard deviation of a correction over itself: priors and first order are both rough. Chosen on
40 draws of eight wrong models, where a third left errors of up to 3.4 stated deviations and a half
of up to 2.8; with the correction the focal length's error was a third of that without."""
BEYOND = 2.0
"""Factor of a design effect above one: errors alike over the whole image are seen by no block. On
five real captures, whose effect is 430 to 830, two left the focal length's error at 0.1 to 0.9
stated deviations and the pose's at up to 2.6."""
BEYOND_DECODED = 4.0
"""The same for maps of a decoder, whose errors the surface follows in one of two components. On 24
photographs (seeds 9300 and 9401) two left 83 % of pose components inside their 95 % intervals, and
four leave 92 %."""


@dataclass(frozen=True, eq=False)
class ModelCheck:
    """What the residuals say of the model."""

    tests: Tests
    plan: list[PlanTest]
    """Of values that frames share and that each might have for itself."""
    effect: float
    """By which the information of independent pixels is divided."""
    causes: Named
    """What may be wrong, the most likely first."""
    nuisance: Nuisance | None = None
    """What is not known of the given values; None where they count as exact."""
    decoded: bool = False
    """Whether the maps say that their errors are alike over some pixels, as a decoder's are."""
    correction: Correction | None = None
    """By how much the estimates are off, as far as the data tell; None where nothing is moved."""
    understated: float = 1.0
    """Noise over that of the residuals, which are smaller as the surface follows them."""
    unchecked: Sequence[Unchecked] = ()
    """Given values that might be grossly wrong without a trace."""

    @property
    def wrong(self) -> bool:
        """Whether the residuals hold more than noise, or the frames want another plan."""
        return self._telling or bool(self.refuted_plan)

    @property
    def accused(self) -> list[ModelCandidate]:
        """The candidates that noise does not explain, the most explaining first."""
        if self.causes.gross:
            return self.causes.candidates[:1]
        limit = -ndtri(FALSE_ALARMS / 2 / max(len(self.tests.candidates), 1)) * self.understated
        unexplained = [c for c in self.causes.candidates if c.deviations > limit]
        return unexplained if self._telling else []

    @property
    def _telling(self) -> bool:
        """Whether there is structure, or some that all candidates together take away.

        Structure is no wonder where a decoder's errors are: there the candidates must take most of
        it away.
        """
        before, after = self.tests.before.structure, self.tests.after.structure
        fall = (before.ratio - after.ratio) / before.white_std
        falls = fall > _FALLS or (fall > _FALLS_FOR_IT and self._one_accused)
        if self.decoded:
            return falls and before.excess - after.excess > _MOST * before.excess
        return _structured(self.tests.before) or falls

    @property
    def _one_accused(self) -> bool:
        return any(c.deviations > _ACCUSED for c in self.tests.candidates)

    @property
    def of_decoder(self) -> bool:
        """Whether there is structure that is put down to a decoder."""
        return self.decoded and not self.wrong and _structured(self.tests.before)

    @property
    def refuted_plan(self) -> list[PlanTest]:
        """What frames have of their own though the plan says they share it.

        Errors of given values differ from frame to frame too, so a plan is to blame only where it
        takes most of the structure away.
        """
        before = self.tests.before.structure
        enough = _PLAN_EXPLAINS * before.excess * self.tests.energy
        plan = [p for p in self.plan if p.gain >= enough]
        if self.causes.gross:
            return [p for p in plan if p.block == self.causes.plan]
        return [p for p in plan if p.chance < FALSE_ALARMS / max(len(self.plan), 1)]

    @property
    def unexplained(self) -> bool:
        """Whether so much structure is left that no interval can be relied on."""
        left = self.tests.after.structure.excess > _UNEXPLAINED
        return self.wrong and left and self.causes.explained < _EXPLAINED

    @property
    def corrects(self) -> bool:
        """Whether estimates move by what the given values' errors, as the data have them, did."""
        return self.correction is not None

    @property
    def correction_std(self) -> float:
        """Standard deviation of what is said of the given values' errors, over itself."""
        return _CORRECTION_STD if self.corrects and not self.unexplained else 1.0

    def surface_error(self, surface: int) -> Floats:
        """Return what may be left (V,) of the error that given values made to a surface."""
        error = self.correction or self.nuisance
        assert error is not None
        return self.correction_std * error.surface_shifts[surface]

    @property
    def added(self) -> Floats | None:
        """(G, G) what errors of the given values add to the covariance, None where nothing."""
        if self.nuisance is None:
            return None
        shifts = self.causes.shifts if self.wrong else []
        own = (self.correction or self.nuisance).shift
        base = own if self.corrects else np.zeros_like(own)
        shifts = [self.correction_std * own, *(s - base for s in shifts)]
        return self.nuisance.covariance + _spread(shifts)


def check_model(
    result: OptimisationResult, rig: Rig, *, decoded: bool = False
) -> ModelCheck | None:
    """Test the model of a fit, which stays as it is.

    Args:
        result: the fit.
        rig: from which it was made.
        decoded: whether the maps' errors are said to be alike over some pixels.

    Returns:
        What was found; None where the fit was interrupted, and nothing can be said.
    """
    if result.outcome is Outcome.INTERRUPTED:
        return None
    variance = result.noise.sigma**2
    extended = extend(result, rig, specials_of(result.problem.law))
    tests = score_tests(extended, rig, variance)
    plan = plan_tests(result, rig, variance * tests.after.effect.largest)
    effect = _beyond(tests.before.effect.largest, BEYOND_DECODED if decoded else BEYOND)
    check = ModelCheck(tests, plan, effect, named(tests, [], ""), decoded=decoded)
    return _doubting(check, extended, rig, variance)


def _doubting(check: ModelCheck, extended: Extended, rig: Rig, variance: float) -> ModelCheck:
    """Return the check with what is not known of the given values."""
    result, tests = extended.result, check.tests
    roots = doubtful(rig, result.problem.layout, stated=not check.wrong)
    if not check.wrong:
        given_errors = (
            nuisance(extended, roots, variance * check.effect, widen=False) if roots else None
        )
        blind = [] if check.decoded else unchecked(extended, rig, variance)
        return replace(check, nuisance=given_errors, unchecked=blind)
    white = not _structured(tests.after) and tests.after.effect.largest <= 1
    effect = 1.0 if white and not check.refuted_plan else check.effect
    causes = named(tests, _refits(result, rig, tests), result.problem.law)
    given_errors = nuisance(extended, roots, variance * effect, widen=True)
    completed = replace(check, effect=effect, causes=causes, nuisance=given_errors)
    if completed.refuted_plan:  # that is no error of given values
        return completed
    priors = {name: np.sqrt(effect) * root for name, root in given_errors.roots.items()}
    return replace(completed, correction=correction(extended, priors, given_errors, causes.ends))


def _refits(result: OptimisationResult, rig: Rig, tests: Tests) -> list[Refit]:
    problem = result.problem
    order = [c.key for c in tests.candidates]
    tried = worth_trying(problem.layout, rig, problem.law, order)
    far = tests.before.structure.excess > _FAR
    # As many pixels as it takes for refits to decide, where the first order promises so much.
    share = _DECIDES * result.noise.sigma**2 / max(tests.gain, 1e-300)
    pixels = round(np.clip(share * problem.observations, PIXELS, _MOST_PIXELS))
    return refits(result, rig, tried, far=far, pixels=pixels)


def with_effect(result: OptimisationResult, formal: Floats, effect: float) -> Floats:
    """Return the covariance (G, G) with the information of the data, not of priors, divided.

    Args:
        result: the fit.
        formal: (G, G) covariance that counts pixels as independent.
        effect: design effect.
    """
    terms = [t for t in result.problem.others if isinstance(t, ResidualTerm)]
    if effect <= 1 or not terms:
        return effect * formal
    priors = sum(J.T @ J for J in (t.jacobian(result.state) for t in terms))
    return inverse_information(inverse_information(formal) / effect + (1 - 1 / effect) * priors)


def _spread(shifts: Sequence[Floats]) -> Floats:
    """Return a covariance (G, G) of shifts of which any may be the true one.

    With their correlations, and so that no variance is below the square of the largest.
    """
    total = sum(np.outer(s, s) for s in shifts)
    largest = np.max(np.abs(shifts), axis=0)
    root = largest / np.sqrt(np.maximum(np.diag(total), 1e-300))
    return total * np.outer(root, root)


def _structured(correlation: Correlation) -> bool:
    return correlation.structure.deviations > STRUCTURED


def _beyond(effect: float, factor: float) -> float:
    return 1 + factor * (effect - 1)

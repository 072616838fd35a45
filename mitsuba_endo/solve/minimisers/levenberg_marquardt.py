"""Levenberg-Marquardt on the rendered projector coordinates.

A step solves (H + mu diag H) delta = -g, with H = J^T W J and g = J^T W r over all unknowns and mu
from :mod:`.damping`. H is never formed whole: :meth:`.NormalEquations.solve` eliminates the
surfaces, :func:`..elimination.schur_complement.solve_step` solves what is left and substitutes
back. Source: Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..costs.noise_scale import STEADY, NoiseScale
from ..costs.objective import Evaluation, Problem, evaluate
from ..elimination.normal_equations import NormalEquations
from ..options import Options
from ..unknowns.state import State
from .damping import FLOOR, Damping
from .minimise import OnIteration, iterate, register_minimiser
from .result import OptimisationResult, trace_row

_LOOSE = 10.0
"""Factor of the tolerance in the first stage."""
_CREEP, _LEAST_GAIN, _PATIENCE = 2.0, 0.05, 2
"""Converged too after so many steps in a row, each below ``_CREEP`` standard deviations, that gain
less log-likelihood than ``_LEAST_GAIN`` per global unknown, as a step of 0.3 standard deviations
does on a smooth cost. A surface of triangles gives a moving camera a cost with kinks, over which
small steps never end."""
_FLAT = (0.3, 8)
"""Stalled after so many steps, however long, that gain so little each: along a direction that the
data do not determine the cost hardly falls, and noise alone decides where it is least."""
_FAR = 3.0
"""Undamped over damped step from which on the damping, not the optimum, keeps steps short: a valley
along which the unknowns are hardly known."""
_TRIES = 8
"""Steps tried in one iteration before it counts as stalled."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """Where the optimisation stands."""

    at: Evaluation
    noise: NoiseScale
    damping: Damping = field(default_factory=Damping)
    gains: tuple[float, ...] = ()
    """Fall of the cost in every iteration, noise variances."""
    trace: tuple[TraceRow, ...] = ()
    outcome: Outcome | None = None
    """How it ended; None = it goes on."""


@dataclass(frozen=True, eq=False)
class Descent:
    """What one iteration tried."""

    at: Evaluation
    damping: Damping
    accepted: bool
    size: float
    """Of the step, in standard deviations of the unknowns."""


@dataclass(frozen=True)
class LevenbergMarquardt:
    """The minimiser: :meth:`init`, then :meth:`step` until it says how it ended."""

    tolerance: float
    """Step, in standard deviations of the unknowns, below which a stage has converged."""
    max_iterations: int
    began: float = field(default_factory=time.perf_counter)

    def run(
        self,
        problem: Problem,
        state: State,
        noise: NoiseScale,
        on_iteration: OnIteration | None = None,
    ) -> OptimisationResult:
        return iterate(self.init(problem, state, noise), self.step, on_iteration)

    def init(self, problem: Problem, state: State, noise: NoiseScale) -> Iterate:
        """Evaluate the starting state."""
        at = evaluate(problem, state)
        return Iterate(at, noise.at(at.noise()))

    def step(self, now: Iterate) -> Iterate:
        """Return what one more iteration leads to."""
        if len(now.trace) >= self.max_iterations:
            return replace(now, outcome=Outcome.MAX_ITERATIONS)
        tried = self.descend(now)
        gain = (now.at.cost(now.noise) - tried.at.cost(now.noise)) / now.noise.sigma**2
        row = trace_row(
            tried.at, now.noise, len(now.trace) + 1, self.began, tried.size, tried.damping.mu
        )
        after = replace(
            now, at=tried.at, damping=tried.damping, gains=(*now.gains, gain),
            trace=(*now.trace, row),
        )  # fmt: skip
        # The first stage only leads to the last one, whose optimum is another.
        settled = tried.size < self.tolerance * (1.0 if now.noise.last else _LOOSE)
        settled |= tried.size < _CREEP and _gained_less(after, _LEAST_GAIN, _PATIENCE)
        flat = tried.size >= _CREEP and _gained_less(after, *_FLAT)
        if not settled and (flat or not tried.accepted):
            return _next_stage(after, Outcome.STALLED)
        followed = after.noise.followed(after.at.noise())
        steady = after.noise.last or followed.sigma > STEADY * after.noise.sigma
        after = replace(after, noise=followed)
        return _next_stage(after, Outcome.CONVERGED) if settled and steady else after

    def descend(self, now: Iterate) -> Descent:
        """Raise the damping until a step lowers the cost."""
        normal = now.at.normal_equations(now.noise)
        problem, damping = now.at.problem, now.damping
        cost, size = now.at.cost(now.noise), np.inf
        for attempt in range(_TRIES):
            try:
                step = normal.solve(damping.mu)
            except np.linalg.LinAlgError:
                damping = damping.raised()
                continue
            size = _size(now.noise, step.schur, step.unknowns, step.surfaces, normal)
            valley = False
            if size < _CREEP and damping.shortens:
                whole, S = normal.undamped()
                short, size = size, max(size, _size(now.noise, S, whole))
                valley = size > max(1.0, _FAR * short)
            trial = evaluate(problem, problem.retract(now.at.state, step.surfaces, step.unknowns))
            if valley and trial.cost(now.noise) > cost:
                trial = _resettled(trial, now.noise)
            if trial.cost(now.noise) <= cost:
                return Descent(trial, damping.accepted(at_once=attempt == 0), True, size)
            if size < self.tolerance:
                break  # at the bottom, where rounding decides
            damping = damping.raised(0.0 if valley else FLOOR)
        return Descent(now.at, damping, False, size)


@register_minimiser("levenberg-marquardt")
def levenberg_marquardt(options: Options) -> LevenbergMarquardt:
    """Return the default minimiser."""
    return LevenbergMarquardt(options.tolerance, options.max_iterations)


def _next_stage(now: Iterate, outcome: Outcome) -> Iterate:
    """Return the beginning of the last stage, or the end with ``outcome``."""
    if now.noise.last:
        return replace(now, outcome=outcome)
    return replace(now, noise=now.noise.final(now.at.noise()))


def _gained_less(now: Iterate, gain: float, steps: int) -> bool:
    """Tell whether each of the last steps gained less log-likelihood per global unknown."""
    unknowns = max(now.at.problem.layout.columns, 1)
    last = now.gains[-steps:]
    return len(last) == steps and max(last) < gain * unknowns


def _resettled(at: Evaluation, noise: NoiseScale) -> Evaluation:
    """Return a trial whose surfaces have followed its global unknowns once more.

    Far along a valley their first-order answer falls short.
    """
    problem = at.problem
    for _ in range(2):
        normal = at.normal_equations(noise)
        surfaces = [-b.damped(0.0).solve(b.g[:, None])[:, 0] for b in normal.surfaces]
        still = np.zeros(problem.layout.columns)
        at = evaluate(problem, problem.retract(at.state, surfaces, still))
    return at


def _size(
    noise: NoiseScale,
    S: NDArray[np.float64],
    step: NDArray[np.float64],
    surfaces: Sequence[NDArray[np.float64]] = (),
    normal: NormalEquations | None = None,
) -> float:
    """Return a step's size in standard deviations of the unknowns.

    For the global unknowns x it is sqrt(x^T S x / G) / sigma with the Schur complement S; of the
    surfaces half the vertices count: some at depth steps never settle, and do not matter.
    """
    parts = [0.0]
    if len(step):
        parts.append(float(np.sqrt(max(step @ S @ step, 0.0) / len(step))))
    for x, block in zip(surfaces, normal.surfaces if normal else (), strict=True):
        parts.append(float(np.median(np.abs(x) * np.sqrt(block.A.diagonal()))))
    return max(parts) / noise.sigma

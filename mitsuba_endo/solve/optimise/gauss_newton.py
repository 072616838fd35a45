"""Levenberg-Marquardt on the rendered projector coordinates."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..cost.normal import NormalEquations
from ..cost.objective import Evaluation, Objective, estimate_noise, evaluate
from ..unknowns.state import State, shared_focal
from ..unknowns.stepping import apply_step
from .optimum import Optimum, make_optimum

_FIRST_DAMPING = 1e-4
_DAMPING_RANGE = (1e-10, 1e-4)
"""Least damping, and the least that a rejected step leads to."""
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
_HARMLESS = 1e-8
"""Damping that does not shorten steps along any valley of interest."""
_TRIES = 8
"""Steps tried in one iteration before it counts as stalled."""


@dataclass(eq=False)
class GaussNewton:
    """The optimiser: :meth:`init`, then :meth:`step` until it says how it ended."""

    objective: Objective
    tolerance: float
    """Step, in standard deviations of the unknowns, below which a stage has converged."""
    max_iterations: int
    on_iteration: Callable[[TraceRow, State], None] | None = None
    trace: list[TraceRow] = field(default_factory=list)

    def run(self, state: State) -> Optimum:
        """Optimise from ``state`` until the steps are small."""
        self.init(state)
        outcome = None
        try:
            while outcome is None:
                outcome = self.step()
        except KeyboardInterrupt:
            if not self.trace:
                raise
            outcome = Outcome.INTERRUPTED
        return make_optimum(outcome, self.objective, self._now, self.trace)

    def init(self, state: State) -> None:
        """Evaluate the starting state."""
        self._began = time.perf_counter()
        self._mu = _FIRST_DAMPING
        self._gains: list[float] = []
        self._now = evaluate(self.objective.problem, state)
        self.objective.sigma = estimate_noise(self._now)

    def step(self) -> Outcome | None:
        """Make one iteration; return how the optimisation ended, or None to go on."""
        if len(self.trace) >= self.max_iterations:
            return Outcome.MAX_ITERATIONS
        before = self.objective.cost(self._now)
        accepted, size = self._descend(self.objective.normal_equations(self._now))
        gain = (before - self.objective.cost(self._now)) / self.objective.sigma**2
        self._record(size)
        # The first stage only leads to the last one, whose optimum is another.
        settled = size < self.tolerance * (_LOOSE if self.objective.stage == 0 else 1.0)
        self._gains.append(gain)
        settled |= size < _CREEP and self._gained_less(_LEAST_GAIN, _PATIENCE)
        flat = size >= _CREEP and self._gained_less(*_FLAT)
        if not settled and (flat or not accepted):
            return self._leave_stage(Outcome.STALLED)
        steady = self.objective.follow(self._now)
        return self._leave_stage(Outcome.CONVERGED) if settled and steady else None

    def _gained_less(self, gain: float, steps: int) -> bool:
        """Tell whether each of the last steps gained less log-likelihood per global unknown."""
        unknowns = max(self.objective.problem.plan.columns, 1)
        last = self._gains[-steps:]
        return len(last) == steps and max(last) < gain * unknowns

    def _leave_stage(self, outcome: Outcome) -> Outcome | None:
        return None if self.objective.next_stage(self._now) else outcome

    def _descend(self, normal: NormalEquations) -> tuple[bool, float]:
        """Raise the damping until a step lowers the cost; return success and the step's size."""
        problem = self.objective.problem
        cost = self.objective.cost(self._now)
        size = np.inf
        for attempt in range(_TRIES):
            try:
                surfaces, step = normal.solve(self._mu)
            except np.linalg.LinAlgError:
                self._raise_damping()
                continue
            size = self._size(normal.schur, step, surfaces, normal)
            valley = False
            if size < _CREEP and self._mu > _HARMLESS:
                whole, S = normal.undamped()
                short, size = size, max(size, self._size(S, whole))
                valley = size > max(1.0, _FAR * short)
            trial = evaluate(problem, apply_step(problem.plan, self._now.state, surfaces, step))
            if valley and self.objective.cost(trial) > cost:
                trial = self._resettled(trial)
            if self.objective.cost(trial) <= cost:
                self._now = trial
                if attempt == 0:  # a damping that was only just enough is needed again
                    self._mu = max(self._mu / 10, _DAMPING_RANGE[0])
                return True, size
            if size < self.tolerance:
                return False, size  # at the bottom, where rounding decides
            self._raise_damping(0.0 if valley else _DAMPING_RANGE[1])
        return False, size

    def _resettled(self, at: Evaluation) -> Evaluation:
        """Return a trial whose surfaces have followed its global unknowns once more.

        Far along a valley their first-order answer falls short.
        """
        problem = self.objective.problem
        for _ in range(2):
            normal = self.objective.normal_equations(at)
            surfaces = [-b.damped(0.0).solve(b.g[:, None])[:, 0] for b in normal.surfaces]
            still = np.zeros(problem.plan.columns)
            at = evaluate(problem, apply_step(problem.plan, at.state, surfaces, still))
        return at

    def _raise_damping(self, least: float = _DAMPING_RANGE[1]) -> None:
        self._mu = max(self._mu * 10, least)

    def _size(
        self,
        S: NDArray[np.float64],
        step: NDArray[np.float64],
        surfaces: Sequence[NDArray[np.float64]] = (),
        normal: NormalEquations | None = None,
    ) -> float:
        """Return a step's size in standard deviations of the unknowns.

        For the global unknowns x it is sqrt(x^T S x / G) / sigma with the Schur complement S; of
        the surfaces half the vertices count: some at depth steps never settle, and do not matter.
        """
        parts = [0.0]
        if len(step):
            parts.append(float(np.sqrt(max(step @ S @ step, 0.0) / len(step))))
        for x, block in zip(surfaces, normal.surfaces if normal else (), strict=True):
            parts.append(float(np.median(np.abs(x) * np.sqrt(block.A.diagonal()))))
        return max(parts) / self.objective.sigma

    def _record(self, size: float) -> None:
        row = trace_row(self.objective, self._now, len(self.trace) + 1, self._began, size, self._mu)
        self.trace.append(row)
        if self.on_iteration is not None:
            self.on_iteration(row, self._now.state)


def trace_row(
    objective: Objective, at: Evaluation, iteration: int, began: float, size: float, damping: float
) -> TraceRow:
    """Describe an iteration that began at ``began`` (``time.perf_counter``)."""
    problem = objective.problem
    return TraceRow(
        iteration=iteration,
        seconds=time.perf_counter() - began,
        cost=objective.cost(at) / max(problem.observations, 1) / objective.sigma**2,
        focal=shared_focal(problem.plan.blocks["focal"], at.state),
        damping=damping,
        scale_px=objective.scale,
        step=size,
    )

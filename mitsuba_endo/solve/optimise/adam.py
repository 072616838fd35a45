"""The published first-order solver: Adam on the same objective and the same unknowns.

The gradient of the rendered coordinates' robust cost comes from one backward pass of Dr.Jit; the
unknowns step in the charts that Gauss-Newton uses. Focal length, translation along the axis,
rotation and the depth of the whole surface form a narrow valley, along which thousands of small
steps are needed.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import drjit
import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..cost.objective import Objective, estimate_noise, evaluate
from ..unknowns.plan import Plan
from ..unknowns.state import State
from ..unknowns.stepping import apply_step
from .gauss_newton import trace_row
from .optimum import Optimum, make_optimum

# Its members depend on the active variant, so it has no static types.
dr: Any = drjit
ROTATION_RATE = 1e-3
"""First learning rate of rotations, radians."""
TRANSLATION_RATE = 1e-2
"""First learning rate of translations, baselines: as many pixels as a rotation moves."""
RATES = {"focal": 1e-3, "centre": 0.3, "aspect": 1e-3, "distortion": 1e-3}
"""First learning rates of the intrinsics: relative, pattern pixels, relative, plain."""
SURFACE_RATE = 3e-3
"""First learning rate of the inverse ranges, relative to their median."""
MEAN_DECAY = 0.95
SQUARE_DECAY = 0.99
"""Gradients fall by orders of magnitude on the way down; Adam's usual 0.999 would remember the
first ones for thousands of iterations and all but stop."""
_WINDOW = 100
"""Iterations between looks at the cost."""
_GAIN = 2e-3
"""Relative fall of the cost over a window below which the steps are too long: rates are halved."""
_LAST_RATE = 2**-8
"""Factor of the learning rates at which a cost that stands still ends a stage."""


@dataclass(eq=False)
class Moments:
    """Adam's running means of a gradient and of its square (Kingma and Ba 2015, algorithm 1)."""

    size: int
    count: int = 0

    def __post_init__(self) -> None:
        self._mean, self._square = np.zeros(self.size), np.zeros(self.size)

    def step(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the step (N,) in units of the learning rates."""
        self.count += 1
        self._mean += (1 - MEAN_DECAY) * (gradient - self._mean)
        self._square += (1 - SQUARE_DECAY) * (gradient * gradient - self._square)
        mean = self._mean / (1 - MEAN_DECAY**self.count)
        square = self._square / (1 - SQUARE_DECAY**self.count)
        return -mean / (np.sqrt(square) + 1e-300)


@dataclass(eq=False)
class Adam:
    """The optimiser: stages of the objective, each until the cost stands still."""

    objective: Objective
    max_iterations: int
    on_iteration: Callable[[TraceRow, State], None] | None = None
    trace: list[TraceRow] = field(default_factory=list)

    def run(self, state: State) -> Optimum:
        """Optimise from ``state`` until the cost stands still."""
        self._began = time.perf_counter()
        self._now = evaluate(self.objective.problem, state)
        self.objective.sigma = estimate_noise(self._now)
        outcome = Outcome.MAX_ITERATIONS
        try:
            outcome = self._stage()
            while outcome == Outcome.CONVERGED and self.objective.next_stage(self._now):
                outcome = self._stage()
        except KeyboardInterrupt:
            if not self.trace:
                raise
            outcome = Outcome.INTERRUPTED
        return make_optimum(outcome, self.objective, self._now, self.trace)

    def _stage(self) -> Outcome:
        """Descend in windows, with shorter steps whenever the cost stands still."""
        state = self._now.state
        rates = surface_rates(state), global_rates(self.objective.problem.plan)
        moments = Moments(sum(map(len, state.rho)) + len(rates[1]))
        rate = 1.0
        while len(self.trace) * _WINDOW < self.max_iterations:
            before = self._now
            state, size = self._descend(moments, before.state, rate * np.concatenate(rates))
            self._now = evaluate(self.objective.problem, state)
            steady = self.objective.follow(self._now)
            self._record(rate * size)
            # Both under the scale of now, or its fall would pass for progress.
            gain = 1 - self.objective.cost(self._now) / self.objective.cost(before)
            if steady and gain < _GAIN:
                if rate <= _LAST_RATE:
                    return Outcome.CONVERGED
                rate /= 2
        return Outcome.MAX_ITERATIONS

    def _descend(
        self, moments: Moments, state: State, rates: NDArray[np.float64]
    ) -> tuple[State, float]:
        """Make the iterations of one window; return the last step's size in rates too."""
        plan = self.objective.problem.plan
        ends = np.cumsum([len(rho) for rho in state.rho])
        relative = np.zeros(len(rates))
        for _ in range(_WINDOW):
            surfaces, globals_ = gradient(self.objective, state)
            relative = moments.step(np.concatenate([*surfaces, globals_]))
            *steps, step = np.split(rates * relative, ends)
            state = apply_step(plan, state, steps, step)
        return state, float(np.abs(relative).max(initial=0.0))

    def _record(self, size: float) -> None:
        iteration = (len(self.trace) + 1) * _WINDOW
        row = trace_row(self.objective, self._now, iteration, self._began, size, 0.0)
        self.trace.append(row)
        if self.on_iteration is not None:
            self.on_iteration(row, self._now.state)


def surface_rates(state: State) -> NDArray[np.float64]:
    """Return the first learning rates of all surfaces, one after the other."""
    return np.concatenate(
        [np.full(len(rho), SURFACE_RATE * float(np.median(rho))) for rho in state.rho]
    )


def global_rates(plan: Plan) -> NDArray[np.float64]:
    """Return the first learning rates (G,) of the global unknowns."""
    rates = np.zeros(plan.columns)
    for (name, _), slot in plan.slots.items():
        if name in RATES:
            rates[slot] = RATES[name]
        else:
            rates[slot] = TRANSLATION_RATE
            rates[slot.start : slot.start + 3] = ROTATION_RATE
    return rates


def gradient(
    objective: Objective, state: State
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the gradient of the cost: per surface (V,), and of the global unknowns (G,).

    Pixels that miss the surface have none.
    """
    problem, plan = objective.problem, objective.problem.plan
    problem.move_surfaces(state)
    surfaces = [
        surface.prior.gradient(rho, objective.sigma)
        for surface, rho in zip(problem.surfaces, state.rho, strict=True)
    ]
    globals_ = np.zeros(plan.columns)
    for k, (frame, renderer) in enumerate(zip(problem.frames, problem.renderers, strict=True)):
        s = plan.surface_of(k)
        d_rho, d_local = renderer.cost_gradient(
            state, k, s, plan.active(k), plan.distortion_terms, frame.q, frame.weight,
            lambda r2: objective.loss(r2, objective.scale, lambda x: dr.log(1 + x)),
        )  # fmt: skip
        surfaces[s] += d_rho
        globals_ += d_local @ plan.local_to_global(state, k)
    if objective.extra is not None:
        globals_ += objective.sigma**2 * objective.extra(state)[1]
    return surfaces, globals_

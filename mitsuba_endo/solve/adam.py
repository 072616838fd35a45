"""The published first-order solver: Adam on the same objective and the same unknowns.

The gradient of the rendered coordinates' robust cost comes from one backward pass of Dr.Jit; the
unknowns step in the charts that Gauss-Newton uses.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..records.calibration import TraceRow
from ..records.solution import Outcome
from ..rendering.untyped import dr, mi
from .gauss_newton import trace_row
from .objective import Objective, estimate_noise, evaluate
from .optimum import Optimum, make_optimum
from .state import State
from .stepping import apply_step

RATES = {"camera_pose": 1e-3, "projector_pose": 1e-3, "focal": 1e-3, "centre": 0.3,
         "aspect": 1e-3, "distortion": 1e-3}  # fmt: skip
"""First learning rates: radians and baselines for poses, relative for focal length and aspect."""
SURFACE_RATE = 3e-3
"""First learning rate of the inverse ranges, relative to their median."""
_LAST_RATE = 0.01
"""Factor that the learning rates have fallen by at the last iteration (cosine schedule)."""
_WINDOW = 100
"""Iterations between looks at the cost."""
_STILL = 1e-6
"""Relative change of the cost over a window that counts as none."""


@dataclass(eq=False)
class Adam:
    """The optimiser: both stages of the objective, half of the iterations each."""

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
            outcome = self._stage(self.max_iterations // 2)
            self.objective.next_stage(self._now)
            outcome = self._stage(self.max_iterations - len(self.trace) * _WINDOW)
        except KeyboardInterrupt:
            if not self.trace:
                raise
            outcome = Outcome.INTERRUPTED
        return make_optimum(outcome, self.objective, self._now, self.trace)

    def _stage(self, iterations: int) -> Outcome:
        """Descend in windows until the cost stands still."""
        optimiser = self._optimiser(self._now.state)
        windows = max(iterations // _WINDOW, 1)
        before = np.inf
        for window in range(windows):
            rate = _LAST_RATE + (1 - _LAST_RATE) * (1 + np.cos(np.pi * window / windows)) / 2
            optimiser.set_learning_rate(rate)
            state, size = self._descend(optimiser, self._now.state)
            self._look(state, size)
            steady = self.objective.follow(self._now)
            cost = self.objective.cost(self._now)
            if steady and abs(before - cost) < _STILL * cost:
                return Outcome.CONVERGED
            before = cost if steady else np.inf
        return Outcome.MAX_ITERATIONS

    def _descend(self, optimiser: Any, state: State) -> tuple[State, float]:
        """Make the iterations of one window."""
        size = 0.0
        for _ in range(_WINDOW):
            surfaces, globals_ = gradient(self.objective, state)
            moves = []
            for name, g in [*((f"surface{i}", g) for i, g in enumerate(surfaces)),
                            ("globals", globals_)]:  # fmt: skip
                before = optimiser[name].numpy()
                # Rates per unknown: the optimiser steps in units of them.
                dr.set_grad(optimiser[name], mi.Float64(g * self._rates[name]))
                moves.append((name, before))
            optimiser.step()
            steps = [(optimiser[n].numpy() - before) * self._rates[n] for n, before in moves]
            size = max(float(np.abs(s).max(initial=0.0)) for s in steps)
            plan = self.objective.problem.plan
            state = apply_step(plan, state, steps[:-1], steps[-1][: plan.columns])
        return state, size

    def _look(self, state: State, size: float) -> None:
        self._now = evaluate(self.objective.problem, state)
        iteration = (len(self.trace) + 1) * _WINDOW
        row = trace_row(self.objective, self._now, iteration, self._began, size, 0.0)
        self.trace.append(row)
        if self.on_iteration is not None:
            self.on_iteration(row, state)

    def _optimiser(self, state: State) -> Any:
        plan = self.objective.problem.plan
        rates = np.zeros(max(plan.columns, 1))
        for (name, _), slot in plan.slots.items():
            rates[slot] = RATES[name]
        self._rates: dict[str, Any] = {"globals": rates}
        optimiser = dr.opt.Adam(lr=1.0)
        optimiser["globals"] = mi.Float64(np.zeros_like(rates))
        for i, rho in enumerate(state.rho):
            self._rates[f"surface{i}"] = SURFACE_RATE * float(np.median(rho))
            optimiser[f"surface{i}"] = mi.Float64(np.zeros_like(rho))
        return optimiser


def gradient(
    objective: Objective, state: State
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Return the gradient of the cost: per surface (V,), and of the global unknowns (G,).

    Pixels that miss the surface have none.
    """
    problem, plan = objective.problem, objective.problem.plan
    problem.move_surfaces(state)
    surfaces = [np.zeros_like(rho) for rho in state.rho]
    globals_ = np.zeros(plan.columns)
    for k, (frame, renderer) in enumerate(zip(problem.frames, problem.renderers, strict=True)):
        s = plan.surface_of(k)
        d_rho, d_local = renderer.cost_gradient(
            state, k, s, plan.active(k), plan.distortion_terms, frame.q,
            lambda r2: objective.loss(r2, objective.scale, lambda x: dr.log(1 + x)),
        )  # fmt: skip
        surfaces[s] += d_rho
        globals_ += d_local @ plan.local_to_global(state, k)
    for i, (surface, rho) in enumerate(zip(problem.surfaces, state.rho, strict=True)):
        surfaces[i] += surface.prior.normal(rho, objective.sigma)[1]
    if objective.extra is not None:
        globals_ += objective.sigma**2 * objective.extra(state)[1]
    padded = np.zeros(max(plan.columns, 1))
    padded[: plan.columns] = globals_
    return surfaces, padded

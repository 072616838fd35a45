"""The published first-order solver: Adam on the same cost and the same unknowns.

The gradient of the rendered coordinates' robust cost comes from one backward pass of Dr.Jit; the
unknowns step in the tangent spaces that Levenberg-Marquardt uses. Focal length, translation along
the axis, rotation and the depth of the whole surface form a narrow valley, along which thousands of
small steps are needed. Written here, in NumPy: Dr.Jit's Adam steps its own arrays, not values on
manifolds, and remembers gradients for too long (see below).
"""

import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..costs.noise_scale import STEADY, NoiseScale
from ..costs.objective import Evaluation, Problem, evaluate, gradient
from ..options import Options
from ..unknowns.block import BLOCKS
from ..unknowns.state import State
from .minimise import OnIteration, iterate, register_minimiser
from .result import OptimisationResult, trace_row

Floats = NDArray[np.float64]

SURFACE_RATE = 3e-3
"""First learning rate of the surfaces' values: motion of a vertex relative to its distance."""
MEAN_DECAY = 0.95
"""Share of the gradients' running mean that an iteration keeps; Adam's usual is 0.9. Chosen."""
SQUARE_DECAY = 0.99
"""Gradients fall by orders of magnitude on the way down; Adam's usual 0.999 would remember the
first ones for thousands of iterations and all but stop."""
_WINDOW = 100
"""Iterations between looks at the cost."""
_GAIN = 2e-3
"""Relative fall of the cost over a window below which the steps are too long: rates are halved."""
_LAST_RATE = 2**-8
"""Factor of the learning rates at which a cost that stands still ends a stage."""


@dataclass(frozen=True, eq=False)
class Moments:
    """Adam's running means of a gradient and of its square (Kingma and Ba 2015, algorithm 1)."""

    mean: Floats
    square: Floats
    count: int = 0

    @classmethod
    def none(cls, size: int) -> "Moments":
        """Return the moments before the first gradient."""
        return cls(np.zeros(size), np.zeros(size))

    def after(self, gradient: Floats) -> "Moments":
        """Return the moments after one more gradient (N,)."""
        return Moments(
            self.mean + (1 - MEAN_DECAY) * (gradient - self.mean),
            self.square + (1 - SQUARE_DECAY) * (gradient * gradient - self.square),
            self.count + 1,
        )

    @property
    def step(self) -> Floats:
        """The step (N,) in units of the learning rates."""
        mean = self.mean / (1 - MEAN_DECAY**self.count)
        square = self.square / (1 - SQUARE_DECAY**self.count)
        return -mean / (np.sqrt(square) + 1e-300)


@dataclass(frozen=True, eq=False)
class AdamIterate:
    """Where the optimisation stands."""

    at: Evaluation
    noise: NoiseScale
    rates: Floats
    """First learning rates of all unknowns in this stage, surfaces first."""
    moments: Moments
    rate: float = 1.0
    """Factor of the learning rates."""
    trace: tuple[TraceRow, ...] = ()
    outcome: Outcome | None = None
    """How it ended; None = it goes on."""


@dataclass(frozen=True)
class Adam:
    """The minimiser: stages of the robust loss, each until the cost stands still."""

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

    def init(self, problem: Problem, state: State, noise: NoiseScale) -> AdamIterate:
        """Evaluate the starting state."""
        at = evaluate(problem, state)
        return _new_stage(at, noise.at(at.noise()))

    def step(self, now: AdamIterate) -> AdamIterate:
        """Return what one more window of iterations leads to."""
        if len(now.trace) * _WINDOW >= self.max_iterations:
            return replace(now, outcome=Outcome.MAX_ITERATIONS)
        state, moments = _descend(now)
        at = evaluate(now.at.problem, state)
        noise = now.noise.followed(at.noise())
        size = now.rate * float(np.abs(moments.step).max(initial=0.0))
        row = trace_row(at, noise, (len(now.trace) + 1) * _WINDOW, self.began, size, 0.0)
        after = replace(now, at=at, noise=noise, moments=moments, trace=(*now.trace, row))
        # Both under the scale of now, or its fall would pass for progress.
        gain = 1 - at.cost(noise) / now.at.cost(noise)
        steady = noise.last or noise.sigma > STEADY * now.noise.sigma
        if not steady or gain >= _GAIN:
            return after
        return replace(after, rate=now.rate / 2) if now.rate > _LAST_RATE else _next_stage(after)


@register_minimiser("adam")
def adam(options: Options) -> Adam:
    """Return the published first-order solver."""
    return Adam(options.adam_iterations)


def _descend(now: AdamIterate) -> tuple[State, Moments]:
    """Make the iterations of one window, with steps in units of the learning rates."""
    problem, state, moments = now.at.problem, now.at.state, now.moments
    ends = np.cumsum([s.size for s in problem.surfaces])
    for _ in range(_WINDOW):
        g = gradient(problem, state, now.noise)
        moments = moments.after(np.concatenate([*g.surfaces, g.unknowns]))
        *surfaces, step = np.split(now.rate * now.rates * moments.step, ends)
        state = problem.retract(state, surfaces, step)
    return state, moments


def _next_stage(now: AdamIterate) -> AdamIterate:
    """Return the beginning of the last stage, or the end."""
    if now.noise.last:
        return replace(now, outcome=Outcome.CONVERGED)
    return replace(_new_stage(now.at, now.noise.final(now.at.noise())), trace=now.trace)


def _new_stage(at: Evaluation, noise: NoiseScale) -> AdamIterate:
    rates = learning_rates(at.problem, at.state)
    return AdamIterate(at, noise, rates, Moments.none(len(rates)))


def learning_rates(problem: Problem, state: State) -> Floats:
    """Return the first learning rates of all unknowns, surfaces first."""
    of_surfaces = [
        np.full(s.size, SURFACE_RATE * s.typical_range(v) / float(np.median(s.slopes(v))))
        for s, v in zip(problem.surfaces, state.surfaces, strict=True)
    ]
    return np.concatenate([*of_surfaces, unknown_rates(problem, state)])


def unknown_rates(problem: Problem, state: State) -> Floats:
    """Return the first learning rates (G,) of the global unknowns."""
    rates = np.zeros(problem.layout.columns)
    for (name, owner), slot in problem.layout.slots.items():
        of_value = BLOCKS[name].rates(state.values[name][owner])
        rates[slot] = of_value[: slot.stop - slot.start]  # a held length has no rate of its own
    return rates

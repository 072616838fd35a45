"""Minimisers by name, and running one on a prepared problem."""

from collections.abc import Callable
from typing import Protocol, TypeVar

from ...errors import InputError
from ...records.calibration import TraceRow
from ...records.solution import Outcome
from ..costs.noise_scale import NoiseScale
from ..costs.objective import Evaluation, Problem
from ..options import Options
from ..unknowns.state import State
from .result import OptimisationResult

Progress = Callable[[float, str], None]
"""Called with the share of the work done and the name of the step."""
OnIteration = Callable[[TraceRow, State], None]


class Minimiser(Protocol):
    """Minimises the cost of a problem."""

    def run(
        self,
        problem: Problem,
        state: State,
        noise: NoiseScale,
        on_iteration: OnIteration | None = None,
    ) -> OptimisationResult:
        """Return where the optimisation from ``state`` ended.

        Args:
            problem: what costs.
            state: where to begin.
            noise: loss to begin with; its sigma is estimated anew.
            on_iteration: called after every iteration.
        """
        ...


MINIMISERS: dict[str, Callable[[Options], Minimiser]] = {}
ALIASES = {"gauss-newton": "levenberg-marquardt"}
"""Names of version 0.1, under which the same is still known."""


def register_minimiser(
    name: str,
) -> Callable[[Callable[[Options], Minimiser]], Callable[[Options], Minimiser]]:
    """Decorate a function that makes a minimiser as the options ask."""

    def register(make: Callable[[Options], Minimiser]) -> Callable[[Options], Minimiser]:
        MINIMISERS[name] = make
        return make

    return register


class Standing(Protocol):
    """Where a minimiser stands, as far as whoever runs it needs to know."""

    @property
    def at(self) -> Evaluation: ...
    @property
    def noise(self) -> NoiseScale: ...
    @property
    def trace(self) -> tuple[TraceRow, ...]: ...
    @property
    def outcome(self) -> Outcome | None: ...


S = TypeVar("S", bound=Standing)


def iterate(now: S, step: Callable[[S], S], on_iteration: OnIteration | None) -> OptimisationResult:
    """Step until a minimiser says how it ended, or the user stops it.

    Raises:
        KeyboardInterrupt: the user stopped before there was anything to go on from.
    """
    try:
        while now.outcome is None:
            rows = len(now.trace)
            now = step(now)
            if on_iteration is not None and len(now.trace) > rows:
                on_iteration(now.trace[-1], now.at.state)
    except KeyboardInterrupt:
        if not now.trace:
            raise
        return OptimisationResult(Outcome.INTERRUPTED, now.at, now.noise, list(now.trace))
    return OptimisationResult(now.outcome, now.at, now.noise, list(now.trace))


def minimise(
    problem: Problem,
    state: State,
    options: Options,
    on_iteration: OnIteration | None = None,
    *,
    last_stage: bool = False,
) -> OptimisationResult:
    """Minimise the cost from ``state`` with the minimiser that the options name.

    ``last_stage`` leaves out the first stage of the robust loss.

    Raises:
        InputError: there is no minimiser of this name.
    """
    noise = NoiseScale(float("inf"), options.finish, last=last_stage)
    return minimiser_of(options).run(problem, state, noise, on_iteration)


def minimiser_of(options: Options) -> Minimiser:
    """Return the minimiser that the options name.

    Raises:
        InputError: there is none of this name.
    """
    name = ALIASES.get(options.solver, options.solver)
    if name not in MINIMISERS:
        raise InputError(
            f"unknown solver '{options.solver}'", "solver",
            f"choose from {', '.join([*MINIMISERS, *ALIASES])}",
        )  # fmt: skip
    return MINIMISERS[name](options)

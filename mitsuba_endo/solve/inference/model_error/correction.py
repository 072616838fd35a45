"""Where a fit would be if the given values were off as its residuals have them.

To first order that is one step (:mod:`.nuisance`), but along the valleys in which poses, given
values and surface make up for one another the cost rises long before that step ends. So of the step
only the given values are taken, after gross errors of the refits, and unknowns and surfaces are
solved for anew beside them. Where that does not lower the cost, given values are free under their
priors, from the best of shorter steps. Where nothing lowers it, nothing moves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...costs.noise_scale import NoiseScale
from ...costs.objective import Evaluation, Problem, evaluate
from ...costs.term import ResidualTerm
from ...minimisers.levenberg_marquardt import LevenbergMarquardt
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout
from ...unknowns.state import State
from .extended import Extended, over
from .nuisance import Nuisance

Floats = NDArray[np.float64]

_SHARES = (0.5, 0.25)
"""Of the step to first order that are tried where the whole of it does not lower the cost."""
_FOLLOWING = 2
"""Times that surfaces follow what moved before its cost is judged. Chosen: inverse ranges are
nearly linear in coordinates."""
_HOLDING = 1e3
"""Factor of the priors' precision with which given values count as held."""
_ITERATIONS = 6
"""Of the minimiser: a fit takes some twenty, and this one begins beside its optimum."""
_TOLERANCE = 0.01
"""Step, standard deviations, at which it ends: far below what half of a correction is."""


@dataclass(frozen=True, eq=False)
class Correction:
    """By how much a fit is off."""

    shift: Floats
    """(G,) of its unknowns."""
    surface_shifts: list[Floats]
    """(V,) of every surface's values."""


@dataclass(frozen=True, eq=False)
class DoubtTerm(ResidualTerm):
    """Differences of given values from what was given, in standard deviations of their priors."""

    layout: Layout
    roots: Mapping[str, Floats]
    """Square-root information (m, width) of every block in doubt."""

    def residual(self, state: State) -> Floats:
        parts = [
            self.roots[name]
            @ BLOCKS[name].difference(self.layout.given[name], state.values[name][owner])
            for name, owner in self.depends_on()
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def depends_on(self) -> Sequence[tuple[str, int]]:
        return [(name, owner) for name, owner in self.layout.slots if name in self.roots]


def correction(
    extended: Extended, roots: Mapping[str, Floats], first: Nuisance, others: Sequence[State] = ()
) -> Correction | None:
    """Return the correction of a fit, None where nothing that was tried lowers the cost.

    Args:
        extended: the fit with its given values' columns.
        roots: square-root information of the given values, against data of which the information
            is divided by no design effect.
        first: by how much unknowns, given values and surfaces are off, to first order.
        others: states of unknowns and given values to which gross errors led, if they did.
    """
    result = extended.result
    problem, judge = _freed(extended, roots), replace(result.noise, last=True)
    minimiser = LevenbergMarquardt(_TOLERANCE, _ITERATIONS)
    base = evaluate(problem, extended.state)
    starts = [_with_values_of(extended, other) for other in others]
    starts = starts or [_stepped(extended, problem, first, 1.0)]
    best = min((_followed(problem, start) for start in starts), key=lambda at: at.cost(judge))
    held = _held(extended, roots, best.state)
    best = evaluate(problem, minimiser.run(held, best.state, judge).state)
    if best.cost(judge) >= base.cost(judge):
        starts = [_stepped(extended, problem, first, share) for share in _SHARES]
        tried = [base, best, *(_followed(problem, start) for start in starts)]
        best = min(tried, key=lambda at: at.cost(judge))
        best = minimiser.run(problem, best.state, judge).evaluation
    if best.cost(judge) >= base.cost(judge):
        return None
    pairs = zip(best.state.surfaces, result.state.surfaces, strict=True)
    own = result.problem.layout.difference(result.state, best.state)
    return Correction(own, [after - at for after, at in pairs])


def _freed(extended: Extended, roots: Mapping[str, Floats]) -> Problem:
    """Return the fit's problem with given values free under their priors."""
    terms = [over(term, extended.layout) for term in extended.result.problem.others]
    return extended.result.problem.with_layout(
        extended.layout, *terms, DoubtTerm(extended.layout, roots)
    )


def _held(extended: Extended, roots: Mapping[str, Floats], state: State) -> Problem:
    """Return the problem with given values all but held where a state has them."""
    values = {name: state.values[name][0] for name in roots}
    layout = replace(extended.layout, given={**extended.layout.given, **values})
    terms = [over(term, extended.layout) for term in extended.result.problem.others]
    tight = {name: _HOLDING * root for name, root in roots.items()}
    return extended.result.problem.with_layout(extended.layout, *terms, DoubtTerm(layout, tight))


def _stepped(extended: Extended, problem: Problem, first: Nuisance, share: float) -> State:
    """Return the state after a share of the step to first order."""
    surfaces = [share * shift for shift in first.surface_shifts]
    return problem.retract(extended.state, surfaces, share * first.step[: extended.layout.columns])


def _with_values_of(extended: Extended, other: State) -> State:
    """Return a state with another's values, where that has all of their components."""
    old, values = extended.result.problem.layout, dict(extended.state.values)
    for name, own in other.values.items():
        if old.free[name] or np.shape(own[0]) == np.shape(values[name][0]):
            values[name] = own
    return replace(extended.state, values=values)


def _followed(problem: Problem, state: State) -> Evaluation:
    """Return an evaluation after surfaces have followed, under a loss that far ones feel too."""
    at = evaluate(problem, state)
    still = np.zeros(problem.layout.columns)
    for _ in range(_FOLLOWING):
        normal = at.normal_equations(NoiseScale(at.noise(), "cauchy"))
        steps = [-block.damped(0.0).solve(block.g[:, None])[:, 0] for block in normal.surfaces]
        at = evaluate(problem, problem.retract(at.state, steps, still))
    return at

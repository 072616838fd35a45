"""A term: anything that costs.

A term owns its residuals, their derivatives, its robust loss and its unit, and says whether it
tells something about the unknowns or only holds them. Nothing else adds to what is minimised.

To add a cost, write one file in this package: a subclass of :class:`ResidualTerm` needs its
residual and the values that it depends on, and no derivative.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..elimination.normal_equations import NormalEquations
from ..unknowns.block import BLOCKS
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .noise_scale import NoiseScale

Floats = NDArray[np.float64]
_STEP = 1e-6
"""Of central differences, in natural units of the unknowns (radians, baselines, logarithms)."""


@dataclass(eq=False)
class Gradient:
    """Derivatives of the cost with respect to all unknowns."""

    surfaces: list[Floats]
    """(V,) of every surface."""
    unknowns: Floats
    """(G,)"""


class Term(ABC):
    """Part of what is minimised, in pattern pixels squared."""

    informative: bool = True
    """Whether it says something about the unknowns; a regulariser of the surface does not."""

    def evaluate(self, state: State) -> Any:
        """Return what the cost at a state needs; by default the state itself."""
        return state

    @abstractmethod
    def cost(self, at: Any, noise: NoiseScale) -> float:
        """Return the cost where :meth:`evaluate` was called."""

    @abstractmethod
    def accumulate(self, normal: NormalEquations, at: Any, noise: NoiseScale) -> None:
        """Add its Gauss-Newton Hessian and gradient to the normal equations."""

    @abstractmethod
    def accumulate_gradient(self, out: Gradient, state: State, noise: NoiseScale) -> None:
        """Add its gradient, for solvers without a Hessian."""


class ResidualTerm(Term):
    """Half the sum of squares of residuals that depend on a few values and on no surface.

    Residuals are in standard deviations of what they are known by; times the noise variance the
    cost has the unit of the others.
    """

    layout: Layout

    @abstractmethod
    def residual(self, state: State) -> Floats:
        """Return the residuals (m,), in standard deviations."""

    @abstractmethod
    def depends_on(self) -> Sequence[tuple[str, int]]:
        """Return the values (block, owner) that the residuals depend on."""

    def cost(self, at: State, noise: NoiseScale) -> float:
        r = self.residual(at)
        return noise.sigma**2 * float(r @ r) / 2

    def jacobian(self, state: State) -> Floats:
        """Return the derivatives (m, G) of the residuals, by central differences."""
        J = np.zeros((len(self.residual(state)), self.layout.columns))
        for name, owner in self.depends_on():
            slot = self.layout.slots.get((name, owner))
            if slot is None:
                continue
            T = self.layout.tangent_map(state, name, owner)
            J[:, slot] += self._derivative(state, name, owner, len(T)) @ T
        return J

    def _derivative(self, state: State, name: str, owner: int, width: int) -> Floats:
        """Return the derivatives (m, width) with respect to a step of one value."""
        value, block = state.values[name][owner], BLOCKS[name]
        columns = []
        for step in np.eye(width) * _STEP:
            ends = [
                self.residual(state.with_value(name, owner, block.retract(value, s)))
                for s in (step, -step)
            ]
            columns.append((ends[0] - ends[1]) / (2 * _STEP))
        return np.array(columns).T

    def accumulate(self, normal: NormalEquations, at: State, noise: NoiseScale) -> None:
        J, r = self.jacobian(at), self.residual(at)
        normal.add_global(noise.sigma**2 * J.T @ J, noise.sigma**2 * J.T @ r)

    def accumulate_gradient(self, out: Gradient, state: State, noise: NoiseScale) -> None:
        out.unknowns += noise.sigma**2 * self.jacobian(state).T @ self.residual(state)

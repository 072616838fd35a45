"""What was given, taken as known to some deviation instead of exactly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..unknowns.block import BLOCKS, Floats, Value
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .term import ResidualTerm


@dataclass(frozen=True, eq=False)
class DoubtTerm(ResidualTerm):
    """Differences of values from what was given, weighed by how well that is known."""

    layout: Layout
    given: Mapping[str, Value]
    roots: Mapping[str, Floats]
    """Square-root information (m, width) of every block in doubt."""

    def residual(self, state: State) -> Floats:
        parts = [
            self.roots[name] @ BLOCKS[name].difference(self.given[name], state.values[name][owner])
            for name, owner in self.depends_on()
        ]
        return np.concatenate(parts)

    def depends_on(self) -> Sequence[tuple[str, int]]:
        return [(name, owner) for name, owner in self.layout.slots if name in self.roots]

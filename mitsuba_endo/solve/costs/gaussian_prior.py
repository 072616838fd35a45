"""Gaussian priors on unknowns that the rig knows to some standard deviation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records.rig import Rig
from ..unknowns.block import BLOCKS
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .registry import register_prior
from .term import ResidualTerm


@dataclass(frozen=True, eq=False)
class GaussianPriorTerm(ResidualTerm):
    """Differences of values from what the rig gives, over their standard deviations."""

    layout: Layout
    std: dict[str, NDArray[np.float64]]
    """Standard deviations (width,) of the blocks that have a prior."""

    def residual(self, state: State) -> NDArray[np.float64]:
        parts = [
            BLOCKS[name].difference(self.layout.given[name], state.values[name][owner])
            / self.std[name]
            for name, owner in self.depends_on()
        ]
        return np.concatenate(parts)

    def depends_on(self) -> Sequence[tuple[str, int]]:
        return [(name, owner) for name, owner in self.layout.slots if name in self.std]


@register_prior
def gaussian_prior(rig: Rig, layout: Layout) -> GaussianPriorTerm | None:
    """Return the prior on every unknown block that the rig gives with a deviation, or None."""
    std = {}
    for name in dict.fromkeys(name for name, _ in layout.slots):
        given = layout.given[name]
        of_block = None if given is None else BLOCKS[name].prior_std(rig, given)
        if of_block is not None:
            std[name] = of_block
    return GaussianPriorTerm(layout, std) if std else None

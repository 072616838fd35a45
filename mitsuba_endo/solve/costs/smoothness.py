"""The smoothness of a surface: a robust prior on its second differences."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..elimination.normal_equations import NormalEquations
from ..surfaces.surface import Bending, Surface
from ..unknowns.state import State
from .noise_scale import NoiseScale
from .term import Gradient, Term

Floats = NDArray[np.float64]
_WEIGHT = 0.02
"""Weight of the prior per observation while calibrating. On a folded stomach wall 0.2 shifts the
focal length by 1.4 standard deviations, 0.02 by less than half of one."""


@dataclass(frozen=True, eq=False)
class SmoothnessTerm(Term):
    """Robust prior on second differences c, in pattern pixels of disparity.

    The energy per second difference is weight * s^2 / 2 * log(1 + (c / s)^2) with s = step_scale *
    sigma: quadratic on smooth surface and nearly flat at a depth step, which therefore does not
    pull on the calibration. The weight is proportional to the number of observations per vertex,
    so that the prior smooths over about one cell whatever the noise. It resists every deformation,
    also those that the data leave free, and therefore is no information.
    """

    informative = False
    index: int
    """Of the surface."""
    bending: Bending
    weight: float
    """Relative to one observation."""
    disparity: float
    """Focal length times baseline in ``bending``, pattern pixels."""
    step_scale: float = 1.0
    """Second difference, in noise standard deviations, beyond which it counts as a step."""

    def weighing(self, weight: float) -> "SmoothnessTerm":
        """Return the term with another weight."""
        return replace(self, weight=weight)

    def cost(self, at: State, noise: NoiseScale) -> float:
        s = self.step_scale * noise.sigma
        c = self._second_differences(at) / s
        return float(self.weight * s * s / 2 * np.log1p(c * c).sum())

    def hessian(self, state: State, noise: NoiseScale) -> sp.csr_array:
        """Return the reweighted Hessian (V, V)."""
        weight = self._weights(self._second_differences(state), noise)
        return (self.bending.operator.T @ (sp.diags_array(weight) @ self.bending.operator)).tocsr()

    def accumulate(self, normal: NormalEquations, at: State, noise: NoiseScale) -> None:
        block = normal.surfaces[self.index]
        block.A = block.A + self.hessian(at, noise)
        block.g += self._gradient(at, noise)

    def accumulate_gradient(self, out: Gradient, state: State, noise: NoiseScale) -> None:
        out.surfaces[self.index] += self._gradient(state, noise)

    def _second_differences(self, state: State) -> Floats:
        return self.bending.operator @ state.surfaces[self.index] + self.bending.offset

    def _weights(self, c: Floats, noise: NoiseScale) -> Floats:
        return self.weight / (1 + (c / (self.step_scale * noise.sigma)) ** 2)

    def _gradient(self, state: State, noise: NoiseScale) -> Floats:
        c = self._second_differences(state)
        return self.bending.operator.T @ (self._weights(c, noise) * c)


def prior_weight(surface: Surface, observations: int, per_observation: float = _WEIGHT) -> float:
    """Return the weight of a prior for as many correspondences on a surface."""
    return per_observation * observations / surface.size


def smoothness(surface: Surface, index: int, weight: float, disparity: float) -> SmoothnessTerm:
    """Build the term of a surface.

    Args:
        surface: whose second differences cost.
        index: of the surface.
        weight: see :func:`prior_weight`.
        disparity: focal length times baseline, which turns inverse range into pattern pixels.
    """
    return SmoothnessTerm(index, surface.bending(disparity), weight, disparity)

"""The robust cost that every solver minimises, and how its scale follows the data."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..unknowns.state import State
from .linearise import Linearisation
from .normal import NormalEquations
from .problem import Problem
from .robust import LOSSES, Loss

MISSED = 10.0
"""Residual, in robust scales, that counts for a pixel whose ray misses the surface."""
_MEDIAN_RADIUS = 1.1774100225154747
"""Median length of a two-dimensional standard normal vector, sqrt(2 ln 2)."""
_SMALLEST_NOISE = 1e-4
"""Floor of the noise estimate, pattern pixels: the precision of a float32 map."""

GlobalTerm = Callable[[State], tuple[NDArray[np.float64], NDArray[np.float64], float]]
"""Further cost over global unknowns: Hessian, gradient and value, in noise variances."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Residuals at a state, and on demand the derivatives."""

    problem: Problem
    state: State
    hits: list[NDArray[np.bool_]]
    """(N,) pixels of every frame whose ray meets the surface."""
    faces: list[NDArray[np.uint32]]
    """(N,) triangle of the lattice that each pixel sees, any where it misses."""
    residuals: list[NDArray[np.float64]]
    """(2, N) rendered minus observed, whitened, zero where missed."""
    _only: list[Linearisation] = field(default_factory=list)

    @property
    def linearisations(self) -> Iterator[Linearisation]:
        """Linearise frame after frame, so that memory holds the derivatives of one."""
        return (self.linearisation(k) for k in range(len(self.hits)))

    def linearisation(self, frame: int) -> Linearisation:
        """Return the whitened derivatives of one frame; those of an only frame are kept."""
        if self._only:
            return self._only[0]
        plan = self.problem.plan
        self.problem.move_surfaces(self.state)
        lin = self.problem.renderers[frame].linearise(
            self.state, frame, plan.surface_of(frame), plan.active(frame), plan.distortion_terms
        )
        if self.problem.frames[frame].weight is not None:
            lin = lin.scaled(self.problem.frames[frame].whitening)
        if plan.frames == 1:
            self._only.append(lin)
        return lin

    def squared(self, frame: int) -> NDArray[np.float64]:
        """(N,) squared whitened residuals of a frame, NaN where missed."""
        r2 = (self.residuals[frame] ** 2).sum(0)
        return np.where(self.hits[frame], r2, np.nan)


@dataclass(eq=False)
class Objective:
    """Robust cost of data and priors, in two stages.

    First the published Cauchy loss, whose scale falls with the residuals; then, with the noise
    fixed, the loss that ends the optimisation.
    """

    problem: Problem
    finish: str
    """Name in :data:`LOSSES` of the last stage's loss."""
    extra: GlobalTerm | None = None
    sigma: float = np.inf
    """Noise of one coordinate, pattern pixels."""
    stage: int = 0

    @property
    def loss(self) -> Loss:
        return LOSSES["cauchy" if self.stage == 0 else self.finish]

    @property
    def scale(self) -> float:
        """Scale of the robust loss, pattern pixels."""
        return self.loss.efficient_scale * self.sigma

    def follow(self, at: Evaluation) -> bool:
        """Let the scale follow the residuals downwards; tell whether it has settled."""
        if self.stage > 0:
            return True
        before = self.sigma
        self.sigma = min(estimate_noise(at), before)
        return self.sigma > 0.98 * before

    def next_stage(self, at: Evaluation) -> bool:
        """Go to the last stage with the noise of the residuals; False if it was the last."""
        if self.stage > 0:
            return False
        self.stage = 1
        self.sigma = estimate_noise(at)
        return True

    def cost(self, at: Evaluation) -> float:
        """Return the cost, pattern pixels squared, over a fixed set of pixels.

        A pixel that misses the surface costs a constant, or pixels that leave the border would
        lower the cost.
        """
        missed = float(self.loss(np.array((MISSED * self.scale) ** 2), self.scale))
        total = 0.0
        for k in range(len(self.problem.frames)):
            r2 = at.squared(k)
            seen = np.isfinite(r2)
            total += float(self.loss(r2[seen], self.scale).sum()) + missed * float((~seen).sum())
        return total + self.prior_cost(at.state)

    def prior_cost(self, state: State) -> float:
        """Return the part of the cost that no observation enters."""
        total = sum(
            surface.prior.cost(rho, self.sigma)
            for surface, rho in zip(self.problem.surfaces, state.rho, strict=True)
        )
        if self.extra is not None:
            total += self.sigma**2 * self.extra(state)[2]
        return total

    def weights(self, at: Evaluation) -> list[NDArray[np.float64]]:
        """Return the robust weights (N,) of every frame, zero where missed."""
        out = []
        for k in range(len(self.problem.frames)):
            r2 = at.squared(k)
            seen = np.isfinite(r2)
            weight = self.loss.weight(np.where(seen, r2, 0.0), self.scale)
            out.append(np.where(seen, weight, 0.0))
        return out

    def normal_equations(self, at: Evaluation) -> NormalEquations:
        """Accumulate the normal equations frame by frame."""
        plan = self.problem.plan
        lattices = [s.lattice for s in self.problem.surfaces]
        normal = NormalEquations.empty(
            [x.size for x in lattices], [x.bandwidth for x in lattices], plan.columns
        )
        for k, weight in enumerate(self.weights(at)):
            normal.add_frame(
                plan.surface_of(k), at.linearisation(k), at.residuals[k], weight,
                plan.local_to_global(at.state, k),
            )  # fmt: skip
        self.add_priors(normal, at.state)
        return normal

    def add_priors(self, normal: NormalEquations, state: State) -> None:
        """Add the surface priors and the terms over global unknowns."""
        for block, surface, rho in zip(
            normal.surfaces, self.problem.surfaces, state.rho, strict=True
        ):
            hessian, gradient = surface.prior.normal(rho, self.sigma)
            block.A = block.A + hessian
            block.g += gradient
        if self.extra is not None:
            hessian, gradient, _ = self.extra(state)
            normal.add_global(self.sigma**2 * hessian, self.sigma**2 * gradient)


def evaluate(problem: Problem, state: State) -> Evaluation:
    """Render every frame at ``state``."""
    problem.move_surfaces(state)
    at = Evaluation(problem, state, [], [], [])
    for k, (frame, renderer) in enumerate(zip(problem.frames, problem.renderers, strict=True)):
        q, _, faces, hit = renderer.render(state, k, problem.plan.surface_of(k))
        at.hits.append(hit)
        at.faces.append(faces)
        at.residuals.append(np.where(hit, frame.whitening * (q - frame.q), 0.0))
    return at


def estimate_noise(at: Evaluation) -> float:
    """Return the robust standard deviation of one whitened component, pattern pixels."""
    r2 = np.concatenate([at.squared(k) for k in range(len(at.residuals))])
    r2 = r2[np.isfinite(r2)]
    if not len(r2):
        return _SMALLEST_NOISE
    return max(float(np.sqrt(np.median(r2))) / _MEDIAN_RADIUS, _SMALLEST_NOISE)

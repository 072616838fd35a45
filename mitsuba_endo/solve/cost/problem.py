"""What is to be solved: observations, surfaces and the plan of unknowns."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ..unknowns.lattice import Lattice
from ..unknowns.plan import Plan
from ..unknowns.state import State
from .linearise import FrameRenderer, SurfaceScene

_WEIGHT = 0.02
"""Weight of the curvature prior per observation while calibrating. On a folded stomach wall 0.2
shifts the focal length by 1.4 standard deviations, 0.02 by less than half of one."""


@dataclass(frozen=True, eq=False)
class Observations:
    """The correspondences of one frame."""

    name: str
    camera: CameraModel
    q: NDArray[np.float64]
    """(2, N) observed projector coordinates, pattern pixels."""
    pixels: NDArray[np.int32]
    """(N, 2) image position (x, y) of every observation."""
    weight: NDArray[np.float64] | None = None
    """(N,) 1 / variance relative to a typical observation; None = all alike."""

    @property
    def whitening(self) -> NDArray[np.float64] | float:
        """(N,) factor that gives every residual the noise of a typical observation."""
        return 1.0 if self.weight is None else np.sqrt(self.weight)

    @property
    def count(self) -> int:
        """N."""
        return len(self.pixels)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the image."""
        return self.camera.height, self.camera.width

    @property
    def rays(self) -> NDArray[np.float64]:
        """(N, 3) unit directions in the camera frame, computed anew: few steps need them."""
        return self.camera.rays(self.pixels.astype(np.float64))


@dataclass(frozen=True, eq=False)
class CurvaturePrior:
    """Robust prior on the surface's second differences c, in pattern pixels of disparity.

    The energy per second difference is weight * s^2 / 2 * log(1 + (c / s)^2) with s = step_scale *
    sigma: quadratic on smooth surface and nearly flat at a depth step, which therefore does not
    pull on the calibration. The weight is proportional to the number of observations per vertex,
    so that the prior smooths over about one cell whatever the noise.
    """

    operator: sp.csr_array
    """(M, V) from inverse ranges to second differences of disparity, pattern pixels."""
    weight: float
    """Relative to one observation."""
    disparity: float
    """Focal length times baseline in ``operator``, pattern pixels."""
    step_scale: float = 1.0
    """Second difference, in noise standard deviations, beyond which it counts as a step."""

    def cost(self, rho: NDArray[np.float64], sigma: float) -> float:
        """Return the energy, pattern pixels squared, for noise ``sigma`` (pattern pixels)."""
        s = self.step_scale * sigma
        c = self.operator @ rho / s
        return float(self.weight * s * s / 2 * np.log1p(c * c).sum())

    def normal(
        self, rho: NDArray[np.float64], sigma: float
    ) -> tuple[sp.csr_array, NDArray[np.float64]]:
        """Return the reweighted Hessian (V, V) and the gradient (V,)."""
        c = self.operator @ rho
        weight = self.weight / (1 + (c / (self.step_scale * sigma)) ** 2)
        weighted = sp.diags_array(weight) @ self.operator
        return (self.operator.T @ weighted).tocsr(), weighted.T @ c

    def gradient(self, rho: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
        """Return the gradient (V,) alone, for solvers without a Hessian."""
        c = self.operator @ rho
        return self.operator.T @ (self.weight * c / (1 + (c / (self.step_scale * sigma)) ** 2))


def prior_weight(density: float) -> float:
    """Return the weight of a prior for ``density`` correspondences per vertex."""
    return _WEIGHT * density


def curvature_prior(lattice: Lattice, weight: float, disparity: float) -> CurvaturePrior:
    """Build the prior of a lattice.

    Args:
        lattice: the surface.
        weight: see :func:`prior_weight`.
        disparity: focal length times baseline, which turns inverse range into pattern pixels.
    """
    operator = (lattice.second_differences() * disparity).tocsr()
    return CurvaturePrior(operator, weight, disparity)


@dataclass(eq=False)
class Surface:
    """One lattice surface of a problem."""

    lattice: Lattice
    prior: CurvaturePrior
    scene: SurfaceScene


@dataclass(eq=False)
class Problem:
    """Observations of all frames, their surfaces, and which unknowns they share."""

    frames: list[Observations]
    surfaces: list[Surface]
    plan: Plan
    law: str
    renderers: list[FrameRenderer]

    @property
    def observations(self) -> int:
        """Number of correspondences of all frames."""
        return sum(f.count for f in self.frames)

    def move_surfaces(self, state: State) -> None:
        """Place the surfaces in Mitsuba at the state's inverse ranges, where rays need them."""
        moving = {self.plan.surface_of(k) for k, r in enumerate(self.renderers) if not r.at_centre}
        for i in moving:
            self.surfaces[i].scene.move(state.rho[i])


def make_problem(
    frames: list[Observations],
    lattices: list[Lattice],
    priors: list[CurvaturePrior],
    plan: Plan,
    law: str,
) -> Problem:
    """Put surfaces into Mitsuba and a renderer before every frame."""
    surfaces = [
        Surface(lattice, prior, SurfaceScene(lattice))
        for lattice, prior in zip(lattices, priors, strict=True)
    ]
    renderers = [
        FrameRenderer(
            surfaces[plan.surface_of(k)].scene, frame.rays, law,
            at_centre=k == 0 or plan.blocks["camera_pose"] == "fixed",
        )
        for k, frame in enumerate(frames)
    ]  # fmt: skip
    return Problem(frames, surfaces, plan, law, renderers)

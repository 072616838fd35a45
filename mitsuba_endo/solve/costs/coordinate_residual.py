"""The data term: rendered minus observed projector coordinates of one frame."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...rendering.mitsuba_modules import dr, mi
from ..elimination.linearisation import Linearisation, whiten
from ..elimination.normal_equations import NormalEquations
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .differentiable_renderer import FrameRenderer
from .noise_scale import NoiseScale
from .term import Gradient, Term

Floats = NDArray[np.float64]

MISSED = 10.0
"""Residual, in robust scales, that counts for a pixel whose ray misses the surface."""


@dataclass(frozen=True, eq=False)
class Observations:
    """The correspondences of one frame."""

    name: str
    camera: CameraModel
    q: Floats
    """(2, N) observed projector coordinates, pattern pixels."""
    pixels: NDArray[np.int32]
    """(N, 2) image position (x, y) of every observation."""
    whitening: Floats | None = None
    """(N,) or (2, 2, N) W that gives every residual the noise of a typical observation: W^T W is
    its inverse covariance relative to that. None = all alike."""

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
        """(N, 3) unit directions in the frame of the camera that the rig gives."""
        return self.camera.grid_rays[self.pixels[:, 1], self.pixels[:, 0]]

    def whitened(self, residual: Floats) -> Floats:
        """Return whitened residuals (2, N)."""
        return residual if self.whitening is None else whiten(residual, self.whitening)

    def unwhitened(self, residual: Floats) -> Floats:
        """Return residuals (2, N), pattern pixels as they are seen, of whitened ones."""
        W = self.whitening
        if W is None:
            return residual
        if W.ndim == 1:
            return residual / W
        rows = np.linalg.solve(np.moveaxis(W, -1, 0), residual.T[..., None])
        return np.asarray(rows[..., 0].T, np.float64)


@dataclass(frozen=True, eq=False)
class FrameResiduals:
    """What a frame's pixels see at a state."""

    state: State
    hits: NDArray[np.bool_]
    """(N,) pixels whose ray meets the surface."""
    faces: NDArray[np.int64]
    """(N,) triangle that each pixel sees, any where it misses."""
    distance: Floats
    """(N,) range along the unit camera ray, baselines."""
    residual: Floats
    """(2, N) rendered minus observed, whitened, zero where missed."""
    kept: list[Linearisation] = field(default_factory=list)
    """The linearisation, where it is kept."""

    @property
    def squared(self) -> Floats:
        """(N,) squared whitened residuals, NaN where missed."""
        return np.where(self.hits, (self.residual**2).sum(0), np.nan)


class CoordinateTerm(Term):
    """Robust cost of one frame's coordinates.

    Args:
        observed: what was decoded.
        renderer: of the same pixels.
        layout: of the unknowns.
        keep: whether to keep the last linearisation; those of many frames would fill the memory.
    """

    def __init__(
        self, observed: Observations, renderer: FrameRenderer, layout: Layout, *, keep: bool
    ) -> None:
        self.observed, self.renderer, self.layout, self._keep = observed, renderer, layout, keep

    def with_layout(self, layout: Layout) -> "CoordinateTerm":
        """Return the term for other unknowns."""
        return CoordinateTerm(self.observed, self.renderer, layout, keep=self._keep)

    @property
    def frame(self) -> int:
        """Index of the frame."""
        return self.renderer.frame

    @property
    def surface(self) -> int:
        """Index of the surface that the frame sees."""
        return self.renderer.surface

    def evaluate(self, state: State) -> FrameResiduals:
        rendered = self.renderer.render(state)
        residual = np.where(rendered.hit, self.observed.whitened(rendered.q - self.observed.q), 0.0)
        return FrameResiduals(state, rendered.hit, rendered.faces, rendered.distance, residual)

    def linearise(self, at: FrameResiduals) -> Linearisation:
        """Return the whitened derivatives."""
        if at.kept:
            return at.kept[0]
        lin = self.renderer.linearise(at.state, self.layout).whitened(self.observed.whitening)
        if self._keep:
            at.kept.append(lin)
        return lin

    def costs(self, at: FrameResiduals, noise: NoiseScale) -> Floats:
        """Return the cost (N,) of every pixel, pattern pixels squared.

        A pixel that misses the surface costs a constant, or pixels that leave the border would
        lower the cost.
        """
        missed = noise.loss(np.array((MISSED * noise.scale) ** 2), noise.scale)
        r2 = at.squared
        return np.where(at.hits, noise.loss(np.where(at.hits, r2, 0.0), noise.scale), missed)

    def cost(self, at: FrameResiduals, noise: NoiseScale) -> float:
        return float(self.costs(at, noise).sum())

    def weights(self, at: FrameResiduals, noise: NoiseScale) -> Floats:
        """Return the robust weights (N,), zero where missed."""
        weight = noise.loss.weight(np.where(at.hits, at.squared, 0.0), noise.scale)
        return np.where(at.hits, weight, 0.0)

    def accumulate(
        self,
        normal: NormalEquations,
        at: FrameResiduals,
        noise: NoiseScale,
        weights: Floats | None = None,
    ) -> None:
        """Add the frame; ``weights`` (N,) replace the robust ones of the residuals."""
        weight = self.weights(at, noise) if weights is None else np.where(at.hits, weights, 0.0)
        T = self.layout.local_from_global(at.state, self.frame)
        normal.add_frame(self.surface, self.linearise(at), at.residual, weight, T)

    def accumulate_gradient(self, out: Gradient, state: State, noise: NoiseScale) -> None:
        def cost(u: Any, v: Any) -> Any:
            r2 = self._squared(u, v)
            return noise.loss(r2, noise.scale, lambda x: dr.log(1 + x))

        of_surface, local = self.renderer.cost_gradient(state, self.layout, cost)
        out.surfaces[self.surface] += of_surface
        out.unknowns += local @ self.layout.local_from_global(state, self.frame)

    def _squared(self, u: Any, v: Any) -> Any:
        """Return the squared whitened residuals on Dr.Jit arrays."""
        du, dv = u - mi.Float64(self.observed.q[0]), v - mi.Float64(self.observed.q[1])
        W = self.observed.whitening
        if W is None:
            return du * du + dv * dv
        if W.ndim == 1:
            return mi.Float64(W * W) * (du * du + dv * dv)
        a, b, c, d = (mi.Float64(np.ascontiguousarray(W[i, j])) for i in (0, 1) for j in (0, 1))
        first, second = a * du + b * dv, c * du + d * dv
        return first * first + second * second

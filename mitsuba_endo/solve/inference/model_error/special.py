"""Errors of a model that are no value of a block: another law, an error that grows outwards."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ....geometry.projection_models import PROJECTION_MODELS
from ...costs.differentiable_renderer import FrameRenderer
from ...minimisers.result import OptimisationResult

Floats = NDArray[np.float64]


class Special(Protocol):
    """One further column of the normal equations."""

    @property
    def key(self) -> str: ...

    @property
    def words(self) -> str: ...

    @property
    def unit(self) -> str:
        """Of the value; empty where only its presence means something."""
        ...

    @property
    def limit(self) -> float:
        """Largest standard deviation, in its unit, with which it is tested."""
        ...

    def column(self, result: OptimisationResult, frame: int) -> Floats:
        """Return the derivative (2, N) of a frame's coordinates, pattern pixels."""
        ...


@dataclass(frozen=True)
class OtherLaw:
    """From the law of the fit to another: the difference of what they render, once."""

    law: str

    @property
    def key(self) -> str:
        return f"law.{self.law}"

    @property
    def words(self) -> str:
        return f"projection model {self.law}"

    unit = ""
    limit = 0.5

    def column(self, result: OptimisationResult, frame: int) -> Floats:
        term = result.problem.frames[frame]
        own = term.renderer
        other = FrameRenderer(
            own.scene, own.camera, term.observed.pixels.astype(np.float64), own.frame,
            own.surface, self.law, rays_stay=own.rays_stay,
        ).render(result.state)  # fmt: skip
        rendered = own.render(result.state)
        return np.where(other.hit & rendered.hit, other.q - rendered.q, 0.0)


@dataclass(frozen=True)
class RadialGain:
    """Scale of the coordinates that changes with the squared distance from the image's centre,
    as of a decoder that reads worse there, or of a lens that no block is.
    """

    unit = "%"
    limit = 5.0
    key = "radial"
    words = "scale that changes with the distance from the image's centre"

    def column(self, result: OptimisationResult, frame: int) -> Floats:
        observed = result.problem.observed[frame]
        height, width = observed.shape
        middle = (np.array([width, height]) - 1) / 2
        radius = np.linalg.norm((observed.pixels - middle) / middle.max(), axis=1)
        q = result.problem.frames[frame].renderer.render(result.state).q
        centre = np.median(observed.q, axis=1, keepdims=True)
        return 0.01 * (q - centre) * radius**2


def specials_of(law: str) -> Sequence[Special]:
    """Return the further columns for a fit under a law."""
    return [*(OtherLaw(name) for name in PROJECTION_MODELS if name != law), RadialGain()]

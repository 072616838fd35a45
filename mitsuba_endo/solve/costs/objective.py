"""The objective E: the sum of the terms, over surfaces and the layout of the other unknowns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ..elimination.linearisation import Linearisation
from ..elimination.normal_equations import NormalEquations
from ..surfaces.surface import Surface
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .coordinate_residual import CoordinateTerm, FrameResiduals, Observations
from .differentiable_renderer import FrameRenderer, SurfaceScene
from .noise_scale import NoiseScale, robust_noise
from .smoothness import SmoothnessTerm
from .term import Gradient, Term

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """Everything that is minimised: the sum of the terms over the unknowns."""

    scenes: Sequence[SurfaceScene]
    """The surfaces, in Mitsuba."""
    layout: Layout
    law: str
    """Name of the projector's projection model."""
    terms: Sequence[Term]

    @cached_property
    def frames(self) -> list[CoordinateTerm]:
        """The data terms, in the order of the frames."""
        return [t for t in self.terms if isinstance(t, CoordinateTerm)]

    @property
    def smoothness(self) -> list[SmoothnessTerm]:
        """The smoothness of every surface."""
        return [t for t in self.terms if isinstance(t, SmoothnessTerm)]

    @property
    def surfaces(self) -> list[Surface]:
        """The surfaces."""
        return [scene.surface for scene in self.scenes]

    @property
    def observed(self) -> list[Observations]:
        """What was decoded in every frame."""
        return [t.observed for t in self.frames]

    @property
    def observations(self) -> int:
        """Number of correspondences of all frames."""
        return sum(o.count for o in self.observed)

    def surface_seen_by(self, frame: int) -> Surface:
        """Return the surface of a frame."""
        return self.scenes[self.layout.surface_of[frame]].surface

    def camera(self, state: State, frame: int = 0) -> CameraModel:
        """Return the camera of a frame at a state."""
        return state.frame_model(frame, self.observed[frame].camera, self.law).camera

    def rays(self, state: State, frame: int) -> Floats:
        """Return the (N, 3) unit rays of a frame's correspondences in its camera's frame."""
        observed, camera = self.observed[frame], self.camera(state, frame)
        if camera is observed.camera:
            return observed.rays
        return camera.rays(observed.pixels.astype(np.float64))

    def projector(self, state: State, frame: int) -> ProjectorModel | None:
        """Return the projector of a frame at a state, see :meth:`State.projector`."""
        return state.projector(frame, self.observed[frame].camera, self.law)

    def place(self, state: State) -> None:
        """Move the surfaces in Mitsuba to the state's values, where rays need them."""
        for i in {t.surface for t in self.frames if not t.renderer.rays_stay}:
            self.scenes[i].move(state.surfaces[i])

    def retract(self, state: State, surfaces: Sequence[Floats], step: Floats) -> State:
        """Return the state after steps of the surfaces' values (V,) and of the unknowns (G,)."""
        moved = [
            surface.retract(values, change)
            for surface, values, change in zip(self.surfaces, state.surfaces, surfaces, strict=True)
        ]
        return self.layout.retract(state, step).with_surfaces(*moved)

    def with_terms(self, *terms: Term) -> "Problem":
        """Return the problem with other terms beside the data."""
        return replace(self, terms=[*self.frames, *terms])

    def with_layout(self, layout: Layout, *terms: Term) -> "Problem":
        """Return the problem over other unknowns, with terms over those beside the data."""
        data = [t.with_layout(layout) for t in self.frames]
        return replace(self, layout=layout, terms=[*data, *terms])

    @property
    def others(self) -> list[Term]:
        """The terms beside the data."""
        return [t for t in self.terms if not isinstance(t, CoordinateTerm)]


def make_problem(
    observed: Sequence[Observations],
    surfaces: Sequence[Surface],
    state: State,
    layout: Layout,
    law: str,
    terms: Sequence[Term],
) -> Problem:
    """Put surfaces into Mitsuba and a renderer before every frame.

    Args:
        observed: correspondences of every frame.
        surfaces: which they see.
        state: where the optimisation starts.
        layout: of the unknowns.
        law: name of the projector's projection model.
        terms: beside the data.
    """
    scenes = [SurfaceScene(s, v) for s, v in zip(surfaces, state.surfaces, strict=True)]
    data = []
    for k, frame in enumerate(observed):
        i = layout.surface_of[k]
        still = layout.slot("camera_pose", k) is None
        renderer = FrameRenderer(
            scenes[i], frame.camera, frame.pixels.astype(np.float64), k, i, law,
            rays_stay=still and surfaces[i].is_centre(state.at("camera_pose", k).t),
        )  # fmt: skip
        data.append(CoordinateTerm(frame, renderer, layout, keep=layout.frames == 1))
    return Problem(scenes, layout, law, [*data, *terms])


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All terms at a state."""

    problem: Problem
    state: State
    parts: Sequence[Any]
    """What every term found, in their order."""

    @cached_property
    def frames(self) -> list[FrameResiduals]:
        """What every frame's pixels see."""
        return [p for p in self.parts if isinstance(p, FrameResiduals)]

    def squared(self, frame: int) -> Floats:
        """(N,) squared whitened residuals of a frame, NaN where missed."""
        return self.frames[frame].squared

    def linearisations(self) -> Iterator[Linearisation]:
        """Linearise frame after frame, so that memory holds the derivatives of one."""
        return (self.linearisation(k) for k in range(len(self.frames)))

    def linearisation(self, frame: int) -> Linearisation:
        """Return the whitened derivatives of one frame."""
        self.problem.place(self.state)
        return self.problem.frames[frame].linearise(self.frames[frame])

    def cost(self, noise: NoiseScale) -> float:
        """Return the cost, pattern pixels squared, over a fixed set of pixels."""
        return sum(t.cost(p, noise) for t, p in zip(self.problem.terms, self.parts, strict=True))

    def weights(self, noise: NoiseScale) -> list[Floats]:
        """Return the robust weights (N,) of every frame, zero where missed."""
        return [t.weights(r, noise) for t, r in zip(self.problem.frames, self.frames, strict=True)]

    def normal_equations(
        self, noise: NoiseScale, weights: Sequence[Floats] | None = None
    ) -> NormalEquations:
        """Accumulate the normal equations term by term.

        Args:
            noise: of the data.
            weights: (N,) of every frame, in place of the robust ones.
        """
        problem = self.problem
        problem.place(self.state)
        normal = NormalEquations.empty(problem.surfaces, problem.layout.columns)
        for term, part in zip(problem.terms, self.parts, strict=True):
            if isinstance(term, CoordinateTerm) and weights is not None:
                term.accumulate(normal, part, noise, weights[term.frame])
            else:
                term.accumulate(normal, part, noise)
        return normal

    def noise(self) -> float:
        """Return the robust standard deviation of one whitened component, pattern pixels."""
        return robust_noise(np.concatenate([r.squared for r in self.frames]))


def evaluate(problem: Problem, state: State) -> Evaluation:
    """Evaluate every term at ``state``."""
    problem.place(state)
    return Evaluation(problem, state, [term.evaluate(state) for term in problem.terms])


def gradient(problem: Problem, state: State, noise: NoiseScale) -> Gradient:
    """Return the gradient of the cost; pixels that miss the surface have none."""
    problem.place(state)
    out = Gradient([np.zeros(s.size) for s in problem.surfaces], np.zeros(problem.layout.columns))
    for term in problem.terms:
        term.accumulate_gradient(out, state, noise)
    return out

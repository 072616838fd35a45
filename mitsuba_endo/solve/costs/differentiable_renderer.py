"""The images R(S, C, P) of one frame at its pixels, and their derivatives by Dr.Jit.

Mitsuba casts the camera's rays; which triangle a pixel sees is held fixed while the coordinate of
the hit point is differentiated. Every parameter is copied per pixel (its tangent), so that one
backward pass a component gives every pixel's row of the Jacobian. No derivative is written by hand.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...rendering.mitsuba_modules import dr, mi
from ...rendering.moving_mesh import MovingMesh, vector
from ...rendering.projector_coordinates import (
    FrameModel,
    Pose,
    camera_rays,
    project_along,
)
from ...rendering.ray_triangle import plane_distance
from ..elimination.linearisation import Linearisation
from ..surfaces.surface import Surface
from ..unknowns.block import BLOCKS
from ..unknowns.layout import Layout
from ..unknowns.state import State, blank_model

Floats = NDArray[np.float64]


class SurfaceScene:
    """A surface in Mitsuba."""

    def __init__(self, surface: Surface, values: Floats) -> None:
        self.surface = surface
        self.faces = [mi.UInt32(np.ascontiguousarray(surface.faces[:, i])) for i in range(3)]
        self._mesh = MovingMesh(surface.vertices(values), surface.faces)
        self._values = values

    def move(self, values: Floats) -> None:
        """Place the vertices at values (V,), unless these already hold."""
        if values is self._values:
            return
        self._values = values
        self._mesh.move(self.surface.vertices(values))

    def cast(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """Return (triangle index, hit) of rays given as double Dr.Jit vectors."""
        return self._mesh.cast(origin, direction)


@dataclass(frozen=True, eq=False)
class Rendered:
    """One frame at N pixels."""

    q: Floats
    """(2, N) projector coordinates, pattern pixels."""
    distance: Floats
    """(N,) range along the unit camera ray, baselines."""
    faces: NDArray[np.int64]
    """(N,) triangle seen, any where none is hit."""
    hit: NDArray[np.bool_]
    """(N,) pixels whose ray meets the surface in front of the projector."""


@dataclass(frozen=True, eq=False)
class _Trace:
    """The same on Dr.Jit arrays, differentiable with respect to the tangents."""

    u: Any
    v: Any
    hit: Any
    faces: Any
    distance: Any


class FrameRenderer:
    """Renders and linearises one frame.

    Args:
        scene: the surface that the frame sees.
        camera: as the rig gives it.
        pixels: (N, 2).
        frame: index of the frame in the state.
        surface: index of its surface in the state.
        law: name of the projector's projection model.
        rays_stay: whether rays never change triangle while the surface's values change: those of a
            lattice of directions, from its centre.
    """

    def __init__(
        self,
        scene: SurfaceScene,
        camera: CameraModel,
        pixels: Floats,
        frame: int,
        surface: int,
        law: str,
        *,
        rays_stay: bool,
    ) -> None:
        self.scene, self.camera, self.law = scene, camera, law
        self.frame, self.surface, self.rays_stay = frame, surface, rays_stay
        self._pixels = pixels
        self._rays = vector(camera.rays(pixels))
        self._seen_once: Any = None

    def at_pixels(self, pixels: Floats) -> "FrameRenderer":
        """Return a renderer of the same frame at other pixels (N, 2)."""
        return FrameRenderer(
            self.scene, self.camera, pixels, self.frame, self.surface, self.law,
            rays_stay=self.rays_stay,
        )  # fmt: skip

    def render(self, state: State) -> Rendered:
        """Return the frame without derivatives."""
        t = self._trace(state, [], {})
        dr.eval(t.u, t.v, t.hit, t.faces, t.distance)
        return Rendered(
            np.stack([t.u.numpy(), t.v.numpy()]),
            t.distance.numpy(),
            t.faces.numpy().astype(np.int64),
            t.hit.numpy().copy(),
        )

    def linearise(self, state: State, layout: Layout) -> Linearisation:
        """Return coordinates and Jacobians with respect to the surface and the active blocks."""
        columns: list[list[Any]] = []
        for component in (0, 1):
            # Tracing twice costs Python time only: Dr.Jit merges the equal parts in one kernel.
            tangents, of_blocks = self._tangents(layout)
            t = self._trace(state, tangents[:3], of_blocks)
            dr.backward(dr.select(t.hit, (t.u, t.v)[component], 0.0))
            columns.append([dr.grad(tangent) for tangent in tangents])
        u, v = dr.detach(t.u), dr.detach(t.v)
        dr.eval(u, v, t.hit, t.faces, columns)
        J = np.array([[c.numpy() for c in row] for row in columns])
        return Linearisation(
            np.stack([u.numpy(), v.numpy()]),
            t.hit.numpy(),
            self.scene.surface,
            t.faces.numpy().astype(np.int64),
            J[:, :3],
            J[:, 3:],
        )

    def cost_gradient(
        self, state: State, layout: Layout, cost: Callable[[Any, Any], Any]
    ) -> tuple[Floats, Floats]:
        """Return the gradient of the sum of cost(u, v) over the hits by one backward pass.

        Args:
            state: where.
            layout: of the unknowns.
            cost: of every pixel's coordinate, on Dr.Jit arrays.

        Returns:
            (V,) with respect to the surface's values and (L,) to the active blocks.
        """
        tangents, of_blocks = self._tangents(layout)
        t = self._trace(state, tangents[:3], of_blocks)
        dr.backward(dr.select(t.hit, cost(t.u, t.v), 0.0))
        columns = [dr.grad(tangent) for tangent in tangents]
        dr.eval(columns, t.faces)
        # Summed afterwards: ten times faster than adding all pixels to one number in the kernel.
        faces, hit_faces = self.scene.surface.faces, t.faces.numpy()
        of_surface = np.zeros(self.scene.surface.size)
        for i, column in enumerate(columns[:3]):
            of_face = np.bincount(hit_faces, column.numpy(), len(faces))
            of_surface += np.bincount(faces[:, i], of_face, len(of_surface))
        return of_surface, np.array([column.numpy().sum() for column in columns[3:]])

    def _tangents(self, layout: Layout) -> tuple[list[Any], dict[str, list[Any]]]:
        """Return a zero per pixel for every parameter that it depends on, and those of blocks."""
        widths = {name: layout.widths[name] for name in layout.active(self.frame)}
        size = dr.width(self._rays)
        tangents = [dr.zeros(mi.Float64, size) for _ in range(3 + sum(widths.values()))]
        dr.enable_grad(tangents)
        of_blocks, start = {}, 3
        for name, width in widths.items():
            of_blocks[name] = tangents[start : start + width]
            start += width
        return tangents, of_blocks

    def _trace(
        self, state: State, of_surface: Sequence[Any], of_blocks: dict[str, list[Any]]
    ) -> _Trace:
        """Trace the frame.

        ``of_surface`` and ``of_blocks`` hold offsets per pixel, zero in value, of the triangle's
        three values and of the blocks; their derivatives are those with respect to the parameters.
        """
        model = self._model(state, of_blocks)
        rays, moved = self._rays_of(model)
        pose = model.world_from_camera
        prim, hit = self._seen(pose, rays, moved)
        values = mi.Float64(state.surfaces[self.surface])
        corners = []
        for i, face in enumerate(self.scene.faces):
            vertex = dr.gather(mi.UInt32, face, prim, hit)
            value = dr.gather(mi.Float64, values, vertex, hit)
            if len(of_surface):
                value = value + of_surface[i]
            corners.append(self.scene.surface.corners(vertex, value, hit))
        distance = plane_distance(pose.t, pose.rotate(rays), corners)
        u, v, front = project_along(model, rays, distance)
        return _Trace(u, v, hit & front, prim, distance)

    def _model(self, state: State, of_blocks: dict[str, list[Any]]) -> FrameModel:
        """Return camera and projector with every block's value and tangent in it."""
        model = blank_model(self.camera, self.law)
        for name, block in BLOCKS.items():
            value, tangent = state.at(name, self.frame), of_blocks.get(name, ())
            if len(tangent) or not block.holds(model, value):
                model = block.attach(model, _lifted(value, tangent))
        return model

    def _rays_of(self, model: FrameModel) -> tuple[Any, bool]:
        """Return the unit rays, and whether they are others than those of the rig's camera."""
        if model.camera is self.camera:
            return self._rays, False
        u, v = (mi.Float64(np.ascontiguousarray(c)) for c in self._pixels.T)
        return camera_rays(model.camera, u, v), True

    def _seen(self, pose: Pose, rays: Any, moved: bool) -> tuple[Any, Any]:
        if moved or not self.rays_stay:
            return self.scene.cast(dr.detach(pose.t), dr.detach(pose.R @ rays))
        if self._seen_once is None:
            self._seen_once = self.scene.cast(pose.t, pose.R @ rays)
            dr.eval(self._seen_once)
        return self._seen_once


def _lifted(value: Any, tangent: Sequence[Any]) -> Any:
    """Return a value on Dr.Jit arrays, not compiled into the kernel, plus its tangent."""
    if isinstance(value, RigidTransform):
        return Pose.of(value, tangent)
    components = [mi.Float64(float(x)) for x in value]
    dr.make_opaque(components)
    if not len(tangent):
        return components
    return [x + t for x, t in zip(components, tangent, strict=True)]

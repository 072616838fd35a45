"""Projector coordinates R(S, C, P) rendered per pixel, and their derivatives by Dr.Jit.

Mitsuba casts the camera's rays; which triangle a pixel sees is held fixed while the coordinate of
the hit point is differentiated. Every parameter is copied per pixel, so that one backward pass for
u and one for v give every pixel's row of the Jacobian. No derivative is written by hand.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.laws import projector_model
from ...rendering.moving_mesh import MovingMesh
from ...rendering.untyped import dr, mi
from ..unknowns.lattice import Lattice
from ..unknowns.plan import SIZES
from ..unknowns.state import INTRINSICS, State


class SurfaceScene:
    """A lattice surface in Mitsuba, with the constants that its derivatives need."""

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        self.directions = _vector(lattice.directions)
        self.faces = [mi.UInt32(np.ascontiguousarray(lattice.faces[:, i])) for i in range(3)]
        self._mesh = MovingMesh(lattice.directions, lattice.faces)
        self._placed: NDArray[np.float64] | None = None

    def move(self, rho: NDArray[np.float64]) -> None:
        """Place the vertices at inverse ranges (V,), unless these already hold."""
        if rho is self._placed:
            return
        self._placed = rho
        self._mesh.move(self.lattice.vertices(rho))

    def cast(self, origin: Any, direction: Any) -> tuple[Any, Any]:
        """Return (triangle index, hit) of rays given as double Dr.Jit vectors."""
        return self._mesh.cast(origin, direction)


@dataclass(frozen=True, eq=False)
class Linearisation:
    """First-order model of one frame's rendered coordinates; rows are the frame's pixels."""

    q: NDArray[np.float64]
    """(2, N) rendered coordinates, pattern pixels."""
    hit: NDArray[np.bool_]
    """(N,) pixels whose ray meets the surface in front of the projector."""
    lattice: Lattice
    """The surface."""
    faces: NDArray[np.int64]
    """(N,) triangle that the pixel sees, any where none is hit."""
    J_surface: NDArray[np.float64]
    """(2, 3, N) derivatives with respect to the inverse ranges of these vertices."""
    J_local: NDArray[np.float64]
    """(2, L, N) derivatives with respect to the frame's active blocks, in the plan's order."""

    def scaled(self, factor: NDArray[np.float64] | float) -> "Linearisation":
        """Return the model whose derivatives are multiplied by a factor (N,) of each pixel."""
        return replace(self, J_surface=factor * self.J_surface, J_local=factor * self.J_local)

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """(N, 3) vertices that the pixel's hit point depends on."""
        return self.lattice.faces[self.faces]


class FrameRenderer:
    """Renders and linearises the coordinates of one frame.

    Args:
        scene: the surface that the frame sees.
        rays: (N, 3) unit camera rays.
        law: of the projector.
        at_centre: whether the camera stays at the lattice's centre: its rays then never change
            triangle.
    """

    def __init__(
        self, scene: SurfaceScene, rays: NDArray[np.float64], law: str, at_centre: bool
    ) -> None:
        self.scene, self.law, self.at_centre = scene, law, at_centre
        self._direction = _vector(rays)
        self._cached: Any = None

    def render(
        self, state: State, frame: int, surface: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint32], NDArray[np.bool_]]:
        """Return (2, N) coordinates, (N,) ranges, (N,) triangles and (N,) hits.

        Where nothing is hit, the triangle is any.
        """
        u, v, hit, face, distance = self._trace(state, frame, surface, [], {})
        dr.eval(u, v, hit, face, distance)
        q = np.stack([u.numpy(), v.numpy()])
        return q, distance.numpy(), face.numpy().copy(), hit.numpy().copy()

    def linearise(
        self, state: State, frame: int, surface: int, active: Sequence[str], terms: int
    ) -> Linearisation:
        """Return coordinates and Jacobians with respect to surface and ``active`` blocks."""
        columns: list[list[Any]] = []
        for component in (0, 1):
            # Tracing twice costs Python time only: Dr.Jit merges the equal parts in one kernel.
            lanes, widths = self._lanes(active, terms)
            u, v, hit, face, _ = self._trace(
                state, frame, surface, lanes[:3], _split(lanes[3:], widths)
            )
            dr.backward(dr.select(hit, (u, v)[component], 0.0))
            columns.append([dr.grad(lane) for lane in lanes])
        u, v = dr.detach(u), dr.detach(v)
        dr.eval(u, v, hit, face, columns)
        J = np.array([[c.numpy() for c in row] for row in columns])
        return Linearisation(
            np.stack([u.numpy(), v.numpy()]),
            hit.numpy(),
            self.scene.lattice,
            face.numpy().astype(np.int64),
            J[:, :3],
            J[:, 3:],
        )

    def cost_gradient(
        self,
        state: State,
        frame: int,
        surface: int,
        active: Sequence[str],
        terms: int,
        q: NDArray[np.float64],
        weight: NDArray[np.float64] | None,
        loss: Callable[[Any], Any],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the gradient of sum loss(weight |R - q|^2) over the hits by one backward pass.

        Args:
            state: where.
            frame: index of the frame.
            surface: index of the surface that it sees.
            active: its blocks of unknowns.
            terms: number of distortion coefficients that are unknowns.
            q: (2, N) observed coordinates.
            weight: (N,) of the observations; None = all alike.
            loss: of squared residuals, on Dr.Jit arrays.

        Returns:
            (V,) with respect to the inverse ranges and (L,) to the active blocks.
        """
        lanes, widths = self._lanes(active, terms)
        u, v, hit, face, _ = self._trace(
            state, frame, surface, lanes[:3], _split(lanes[3:], widths)
        )
        du, dv = u - mi.Float64(q[0]), v - mi.Float64(q[1])
        r2 = du * du + dv * dv
        if weight is not None:
            r2 = r2 * mi.Float64(weight)
        dr.backward(dr.select(hit, loss(r2), 0.0))
        columns = [dr.grad(lane) for lane in lanes]
        dr.eval(columns, face)
        # Summed afterwards: ten times faster than adding all pixels to one number in the kernel.
        d_rho = np.zeros(self.scene.lattice.size)
        faces, seen = self.scene.lattice.faces, face.numpy()
        for i, column in enumerate(columns[:3]):
            of_face = np.bincount(seen, column.numpy(), len(faces))
            d_rho += np.bincount(faces[:, i], of_face, len(d_rho))
        return d_rho, np.array([column.numpy().sum() for column in columns[3:]])

    def _lanes(self, active: Sequence[str], terms: int) -> tuple[list[Any], dict[str, int]]:
        """Return a zero per pixel for every parameter that it depends on, and block widths."""
        widths = {name: terms if name == "distortion" else SIZES[name] for name in active}
        size, count = dr.width(self._direction), 3 + sum(widths.values())
        lanes = [dr.zeros(mi.Float64, size) for _ in range(count)]
        dr.enable_grad(lanes)
        return lanes, widths

    def _trace(
        self, state: State, frame: int, surface: int, d_rho: list[Any], d: dict[str, list[Any]]
    ) -> tuple[Any, Any, Any, Any, Any]:
        """Trace u, v, the hit mask, the triangle seen and the range.

        ``d_rho`` and ``d`` hold offsets per pixel, zero in value, of the triangle's three inverse
        ranges and of the blocks; their derivatives are those with respect to the parameters.
        """
        camera = state.world_from_camera[frame]
        origin, w = _constant(camera.t), _rotation(camera.R) @ self._direction
        prim, hit = self._seen(origin, w)
        triangle = [dr.gather(mi.UInt32, face, prim, hit) for face in self.scene.faces]
        rho = mi.Float64(state.rho[surface])
        corners = []
        for i, vertex in enumerate(triangle):
            inverse = dr.gather(mi.Float64, rho, vertex, hit)
            if d_rho:
                inverse = inverse + d_rho[i]
            corners.append(dr.gather(mi.Vector3d, self.scene.directions, vertex, hit) / inverse)
        if "camera_pose" in d:
            turn, shift = _halves(d["camera_pose"])
            w = w + dr.cross(turn, w)
            origin = origin + shift
        normal = dr.cross(corners[1] - corners[0], corners[2] - corners[0])
        distance = dr.dot(normal, corners[0] - origin) / dr.dot(normal, w)
        u, v, front = self._project(state, frame, distance, d)
        return u, v, hit & front, prim, distance

    def _seen(self, origin: Any, w: Any) -> tuple[Any, Any]:
        if not self.at_centre:
            return self.scene.cast(origin, w)
        if self._cached is None:
            self._cached = self.scene.cast(origin, w)
            dr.eval(self._cached)
        return self._cached

    def _project(
        self, state: State, frame: int, distance: Any, d: dict[str, list[Any]]
    ) -> tuple[Any, Any, Any]:
        """Project the points ``distance`` along the camera rays into the pattern."""
        pose = state.projector_from_camera[frame]
        turned = _rotation(pose.R) @ self._direction
        t = _constant(pose.t)
        if "projector_pose" in d:
            turn, shift = _halves(d["projector_pose"])
            turned = turned + dr.cross(turn, turned)
            t = t + shift
        # Laws ignore the length of their argument; dividing by the distance keeps it near one.
        Y = turned + t / distance
        front = Y.z > 0
        values = [mi.Float64(x) for x in state.intrinsics[frame]]
        dr.make_opaque(values)
        for name, place in INTRINSICS.items():
            for offset, lane in enumerate(d.get(name, ())):
                values[place.start + offset] = values[place.start + offset] + lane
        distorted = "distortion" in d or np.any(state.intrinsics[frame][INTRINSICS["distortion"]])
        model = projector_model(
            self.law, dr.exp(values[0]), values[1:3], dr.exp(values[3]),
            values[4:9] if distorted else (),
        )  # fmt: skip
        u, v = model.project_xyz(Y.x, Y.y, dr.select(front, Y.z, 1.0))
        return u, v, front


def _split(lanes: list[Any], widths: dict[str, int]) -> dict[str, list[Any]]:
    out, start = {}, 0
    for name, width in widths.items():
        out[name] = lanes[start : start + width]
        start += width
    return out


def _halves(six: Sequence[Any]) -> tuple[Any, Any]:
    return mi.Vector3d(*six[:3]), mi.Vector3d(*six[3:])


def _vector(values: NDArray[np.float64]) -> Any:
    """Return an (N, 3) array as a Dr.Jit vector."""
    return mi.Vector3d(*(np.ascontiguousarray(values[:, i], np.float64) for i in range(3)))


def _constant(values: NDArray[np.float64]) -> Any:
    """Return a (3,) vector that is not compiled into the kernel."""
    vector = mi.Vector3d(*(mi.Float64(float(x)) for x in values))
    dr.make_opaque(vector)
    return vector


def _rotation(R: NDArray[np.float64]) -> Any:
    """Return a (3, 3) rotation that is not compiled into the kernel."""
    matrix = mi.Matrix3d(R.tolist())
    dr.make_opaque(matrix)
    return matrix

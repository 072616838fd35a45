"""The table "Adding things" of docs/architecture.md, row by row: each thing added in one piece.

What stands between a row's markers here is what its author would write in one file. Nothing else of
the package is touched, and everything is taken back afterwards.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mitsuba_endo.geometry import projection_models
from mitsuba_endo.geometry.arrays import namespace
from mitsuba_endo.geometry.cameras import CAMERAS, CameraModel, register_camera
from mitsuba_endo.geometry.projection_models import PROJECTION_MODELS, register_projection_model
from mitsuba_endo.geometry.transforms import rotation_angle
from mitsuba_endo.records import sharing
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.rendering.mitsuba_modules import dr, mi
from mitsuba_endo.rendering.moving_mesh import vector
from mitsuba_endo.rendering.projector_coordinates import FrameModel
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.costs.objective import make_problem
from mitsuba_endo.solve.costs.registry import PRIORS, register_prior
from mitsuba_endo.solve.costs.smoothness import smoothness
from mitsuba_endo.solve.costs.term import ResidualTerm
from mitsuba_endo.solve.minimisers.levenberg_marquardt import LevenbergMarquardt
from mitsuba_endo.solve.minimisers.minimise import MINIMISERS, minimise, register_minimiser
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.surfaces.edge_bending import bending_operator
from mitsuba_endo.solve.surfaces.inverse_range_lattice import Lattice
from mitsuba_endo.solve.surfaces.registry import SURFACES, register_surface
from mitsuba_endo.solve.surfaces.surface import Bending, Surface
from mitsuba_endo.solve.unknowns.block import BLOCKS, Floats, VectorBlock, register_block
from mitsuba_endo.solve.unknowns.layout import Layout
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import cast, lopsided_camera, with_noise
from tests.solve.problems import POSE, SHEET, map_of, problem_of, rig_file, small_rig

pytestmark = pytest.mark.usefixtures("llvm")
QUICK = Options(jackknife=False)


@pytest.fixture(autouse=True)
def registries_as_before() -> Iterator[None]:
    registries: list[Any] = [BLOCKS, MINIMISERS, SURFACES, PROJECTION_MODELS, CAMERAS]
    further = sharing._FURTHER_BLOCKS
    kept = [dict(r) for r in registries], list(PRIORS), set(further)
    yield
    for registry, before in zip(registries, kept[0], strict=True):
        registry.clear()
        registry.update(before)
    PRIORS[:] = kept[1]
    further.clear()
    further.update(kept[2])


def test_an_unknown() -> None:
    """Oracle: the skew of the pattern that was put into the map, and its place in the results."""

    # --- one file in solve/unknowns/ ---
    @dataclass(frozen=True)
    class Skewed:
        projector: Any
        skew: Any

        def project_xyz(self, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
            u, v = self.projector.project_xyz(x, y, z)
            return u + self.skew * (v - self.projector.centre[1]), v

    @register_block
    class Skew(VectorBlock):
        name: ClassVar[str] = "skew"
        words: ClassVar[str] = "pattern skew"

        def given(self, rig: Rig) -> Floats:
            return np.zeros(1)

        def holds(self, model: FrameModel, value: Any) -> bool:
            return not np.any(value)

        def attach(self, model: FrameModel, value: Any) -> FrameModel:
            return replace(model, projector=Skewed(model.projector, value[0]))

    # ---
    rig = with_noise(small_rig("direction_cosine"), 0.1, 0)
    q = rig.q.copy()
    q[..., 0] += 0.02 * (q[..., 1] - rig.projector.centre[1])
    record = rig_file(rig, share={"skew": "shared"}, projector={"focal": 330.0})
    solution = calibrate([map_of(replace(rig, q=q))], record, QUICK).solution
    estimate = solution.blocks["skew"]
    assert isinstance(estimate.value, float)
    assert isinstance(estimate.std, float)
    assert estimate.value == pytest.approx(0.02, abs=min(4 * estimate.std, 2e-3))
    assert any(line.startswith("Pattern skew: 0.0") for line in solution.verdict)


def test_a_cost() -> None:
    """Oracle: no turn between two projector poses, where data alone say 1.4 degrees."""

    # --- one file in solve/costs/ ---
    @dataclass(frozen=True, eq=False)
    class KnownTurn(ResidualTerm):
        layout: Layout
        std: float

        def residual(self, state: State) -> NDArray[np.float64]:
            a, b = state.projector_poses[:2]
            return Rotation.from_matrix(b.R @ a.R.T).as_rotvec() / self.std

        def depends_on(self) -> Sequence[tuple[str, int]]:
            return [("projector_pose", 0), ("projector_pose", 1)]

    @register_prior
    def known_turn(rig: Rig, layout: Layout) -> KnownTurn | None:
        return KnownTurn(layout, 1e-6) if layout.frames == 2 else None

    # ---
    first = with_noise(small_rig("pinhole"), 0.3, 0)
    turned = POSE.perturbed(np.array([0.01, 0.02, -0.01, 0, 0, 0]))
    second = with_noise(cast(first.camera, first.projector, first.size, turned, SHEET), 0.3, 1)
    share = {"surface": "per_frame", "projector_pose": "per_frame"}
    problem, state = problem_of([first, second], rig_file(first, share=share))
    result = minimise(problem, state, QUICK)
    a, b = result.state.projector_poses
    assert rotation_angle(a.R @ b.R.T) < 1e-5
    assert rotation_angle(POSE.R @ turned.R.T) > 1e-2


def test_a_surface() -> None:
    """Oracle: the lattice's solution, with range in place of inverse range as the unknown."""

    # --- one file in solve/surfaces/ ---
    @register_surface
    @dataclass(frozen=True, eq=False)
    class Depths(Surface):
        kind = "depths"
        directions: Floats
        faces: NDArray[np.int64]

        def record(self) -> dict[str, NDArray]:
            return {"directions": self.directions, "faces": self.faces}

        @classmethod
        def from_record(cls, arrays: Mapping[str, NDArray]) -> "Depths":
            return cls(arrays["directions"], arrays["faces"])

        @property
        def size(self) -> int:
            return len(self.directions)

        def vertices(self, values: Floats) -> Floats:
            return values[:, None] * self.directions

        def slopes(self, values: Floats) -> Floats:
            return np.ones_like(values)

        def retract(self, values: Floats, step: Floats) -> Floats:
            return np.maximum(values + step, 0.1 * values)

        def corners(self, vertex: Any, value: Any, active: Any) -> Any:
            return value * dr.gather(mi.Vector3d, vector(self.directions), vertex, active)

        def bending(self, disparity: float) -> Bending:
            K, _ = bending_operator(self.directions, self.faces)
            return Bending((K * (disparity / 150)).tocsr())

        def bridges(self, values: Floats) -> NDArray[np.bool_]:
            return np.zeros(len(self.faces), bool)

        def coarsened(self, room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
            return np.arange(self.size), self.faces

        def is_centre(self, point: Floats) -> bool:
            return not point.any()

    # ---
    rig = with_noise(small_rig("direction_cosine"), 0.1, 0)
    problem, state = problem_of([rig])
    (lattice,), (term,) = problem.surfaces, problem.smoothness
    assert isinstance(lattice, Lattice)
    depths = Depths(lattice.directions, lattice.faces)
    on_depths = state.with_surfaces(1 / state.surfaces[0])
    terms = [smoothness(depths, 0, term.weight, term.disparity)]
    other = make_problem(problem.observed, [depths], on_depths, problem.layout, problem.law, terms)
    expected, found = minimise(problem, state, QUICK), minimise(other, on_depths, QUICK)
    assert found.outcome is Outcome.CONVERGED
    assert found.state.focals[0] == pytest.approx(expected.state.focals[0], rel=5e-4)
    close = np.median(np.abs(found.state.surfaces[0] * expected.state.surfaces[0] - 1))
    assert close < 2e-3


def test_a_solver() -> None:
    """Oracle: the default minimiser's result, under the name that was registered."""

    # --- one file in solve/minimisers/ ---
    @register_minimiser("patient")
    def patient(options: Options) -> LevenbergMarquardt:
        return LevenbergMarquardt(options.tolerance / 4, 2 * options.max_iterations)

    # ---
    rig = with_noise(small_rig("pinhole"), 0.3, 0)
    usual, other = (
        calibrate([map_of(rig)], rig_file(rig), Options(solver=s, jackknife=False)).solution
        for s in ("levenberg-marquardt", "patient")
    )
    std = usual.projector.focal.std
    assert isinstance(std, float)
    limit = min(std, 1e-3 * rig.projector.focal)
    assert other.projector.focal.value == pytest.approx(usual.projector.focal.value, abs=limit)


def test_a_projection_model() -> None:
    """Oracle: the focal length behind a map of an equidistant projector, and the wrong models'
    larger noise."""

    # --- one class with @register_projection_model ---
    @register_projection_model
    class Equidistant:
        name: ClassVar[str] = "equidistant"

        def normalise(self, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
            xp = namespace(x, y, z)
            r = xp.sqrt(x * x + y * y + 1e-24)
            scale = xp.atan2(r, z) / r
            return scale * x, scale * y

        def direction(self, a: Any, b: Any) -> tuple[Any, Any, Any]:
            xp = namespace(a, b)
            theta = xp.sqrt(a * a + b * b + 1e-24)
            scale = xp.sin(theta) / theta
            return scale * a, scale * b, xp.cos(theta)

        def density(self, x: Any, y: Any, z: Any) -> Any:
            xp = namespace(x, y, z)
            r, length = xp.sqrt(x * x + y * y), xp.sqrt(x * x + y * y + z * z)
            return xp.where(r > 0, xp.atan2(r, z) * length / xp.where(r > 0, r, 1.0), 1.0)

    # ---
    model = projection_models.projector_model("equidistant", 330.0, (250.0, 205.0))
    rig = with_noise(cast(lopsided_camera(96, 80), model, (512, 400), POSE, SHEET), 0.1, 0)
    solution = calibrate([map_of(rig)], rig_file(rig), QUICK).solution
    assert solution.projector.focal.value == pytest.approx(330.0, rel=5e-3)
    assert solution.noise_px == pytest.approx(0.1, rel=0.15)


def test_a_camera_model() -> None:
    """Oracle: the focal length behind a map seen through a stereographic lens."""

    # --- one class with @register_camera ---
    @register_camera
    class Stereographic:
        name: ClassVar[str] = "stereographic"
        max_coefficients: ClassVar[tuple[int, ...]] = (0,)
        coefficients: ClassVar[tuple[str, ...]] = ()

        def normalise(self, coefficients: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
            shifted = z + namespace(x, y, z).sqrt(x * x + y * y + z * z)
            return 2 * x / shifted, 2 * y / shifted

        def direction(self, coefficients: Any, a: Any, b: Any) -> tuple[Any, Any, Any]:
            return a, b, 1 - (a * a + b * b) / 4

        def density(self, coefficients: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any]:
            length = namespace(x, y, z).sqrt(x * x + y * y + z * z)
            scale = 2 * length / (z + length)
            return scale * scale, z > -length

        def projectable(self, coefficients: Any, x: Any, y: Any, z: Any) -> Any:
            return z > -0.9 * namespace(x, y, z).sqrt(x * x + y * y + z * z)

        def reach(self, coefficients: Any, angle: float) -> float:
            return float(2 * np.tan(angle / 2))

    # ---
    K = np.array([[88.0, 0, 47.0], [0, 91.0, 42.0], [0, 0, 1]])
    camera = CameraModel("stereographic", 96, 80, K)
    plain = small_rig("direction_cosine")
    rig = with_noise(cast(camera, plain.projector, plain.size, POSE, SHEET), 0.1, 0)
    solution = calibrate([map_of(rig)], rig_file(rig), QUICK).solution
    assert solution.projector.focal.value == pytest.approx(330.0, rel=5e-3)
    assert solution.camera is not None
    assert solution.camera.model == "stereographic"

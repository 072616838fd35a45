"""The triangle mesh as a surface. Oracles: affine functions, differences, the lattice."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh

from mitsuba_endo.fusion import FusedMesh
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.solve import pipeline
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.costs.objective import Problem, evaluate, make_problem
from mitsuba_endo.solve.costs.smoothness import smoothness
from mitsuba_endo.solve.frames.edge_lengths import edge_lengths
from mitsuba_endo.solve.frames.joint import joint_problem
from mitsuba_endo.solve.inference.fit import FrameSolution
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.surfaces.edge_bending import bending_operator
from mitsuba_endo.solve.surfaces.inverse_range_lattice import Lattice, lattice_over
from mitsuba_endo.solve.surfaces.triangle_mesh import TriangleMesh, triangle_mesh
from mitsuba_endo.solve.unknowns.state import State
from scripts.benchmarks.frames import make_frames, sheet_distances
from scripts.benchmarks.joint import errors
from tests.solve.problems import problem_of, small_rig
from tests.solve.views import Views, focal_error, frame_errors, relief

LATTICE_ROWS, MESH_ROWS = 2, 3
"""Second differences per vertex: weights of equal strength are in the inverse ratio."""


def lopsided() -> tuple[np.ndarray, np.ndarray]:
    """Vertices (V, 3) and faces of a patch of a lattice, not square, at ranges about 12."""
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-0.5, 0.6, 15), np.linspace(-0.4, 0.35, 11))
    d = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3)
    lattice = lattice_over(d / np.linalg.norm(d, axis=1, keepdims=True), 0.06)
    return lattice.vertices(1 / rng.normal(12, 0.02, lattice.size)), lattice.faces


def as_mesh(problem: Problem, state: State) -> tuple[Problem, State]:
    """A lattice's own triangles as a mesh whose vertices move along the lattice's rays."""
    (lattice,), (term,) = problem.surfaces, problem.smoothness
    at = lattice.vertices(state.surfaces[0])
    mesh, _ = triangle_mesh(at, lattice.faces, at, np.linalg.norm(at, axis=1))
    state = state.with_surfaces(np.zeros(mesh.size))
    weight = term.weight * LATTICE_ROWS / MESH_ROWS
    others = [t for t in problem.others if t is not term]
    terms = [smoothness(mesh, 0, weight, term.disparity), *others]
    args = problem.observed, [mesh], state, problem.layout, problem.law, terms
    return make_problem(*args), state


class TestHinges:
    def test_vanish_for_affine_functions_over_a_plane(self) -> None:
        """Oracle: second differences of an affine function."""
        vertices, faces = lopsided()
        flat = vertices * (12 / (vertices @ [0.2, -0.1, 1.0]))[:, None]
        K, corners = bending_operator(flat, faces)
        assert np.abs(K @ (flat @ [1.0, -2.0, 0.5] + 3)).max() < 1e-11
        inner = 3 * len(faces) - len(np.unique(np.sort(_edges(faces), axis=1), axis=0))
        assert K.shape == (inner, len(vertices))
        assert corners.shape == (inner, 4)

    def test_measure_the_bend_of_a_fold(self) -> None:
        """Oracle: two triangles of height 3 and 5 that meet at slopes 0.2 and -0.1 bend by 0.3."""
        vertices = np.array([[0.0, 0, 0], [0, 4, 0], [3, 1, 0.6], [-5, 2, 0.5]])
        K, corners = bending_operator(
            np.c_[vertices[:, :2], np.zeros(4)], np.array([[0, 1, 2], [1, 0, 3]])
        )
        assert sorted(corners[0].tolist()) == [0, 1, 2, 3]
        assert (K @ vertices[:, 2])[0] == pytest.approx(4 * (0.6 / 3 + 0.5 / 5))


class TestTriangleMesh:
    def test_bending_is_affine_in_the_values(self, llvm: str) -> None:
        """Oracle: the operator on displaced positions along the edges' normals."""
        vertices, faces = lopsided()
        distances = np.linalg.norm(vertices, axis=1)
        mesh, order = triangle_mesh(vertices, faces, vertices, distances)
        np.testing.assert_allclose(mesh.anchors, vertices[order])
        values = np.random.default_rng(1).normal(0, 0.1, mesh.size)
        bending = mesh.bending(100.0)
        K, corners = bending_operator(mesh.anchors, mesh.faces)
        moved = K @ mesh.vertices(values)
        scale = 100.0 / mesh.distances[corners].mean(1) ** 2
        along = np.einsum("ec,ec->e", moved, mesh._edge_normals(corners))
        np.testing.assert_allclose(
            bending.operator @ values + bending.offset, scale * along, atol=1e-10
        )

    def test_renumbering_keeps_the_band_narrow(self, llvm: str) -> None:
        """Oracle: the lattice's own order, from vertices in random order."""
        rays = small_rig("pinhole").camera.grid_rays.reshape(-1, 3)
        lattice = lattice_over(rays, 0.03)
        rng = np.random.default_rng(2)
        place = rng.permutation(lattice.size)
        at = np.empty((lattice.size, 3))
        at[place] = lattice.vertices(np.full(lattice.size, 0.1))
        mesh, _ = triangle_mesh(at, place[lattice.faces], at, np.linalg.norm(at, axis=1))
        assert mesh.bandwidth < 2 * lattice.bandwidth
        pattern = sp.coo_array(mesh.bending(1.0).operator.T @ mesh.bending(1.0).operator)
        assert np.abs(pattern.coords[0] - pattern.coords[1]).max() <= mesh.bandwidth

    def test_jacobian(self, llvm: str) -> None:
        """Oracle: central differences of the rendered coordinates, and those of the lattice."""
        problem, state = as_mesh(*problem_of([small_rig("direction_cosine")]))
        lin = evaluate(problem, state).linearisation(0)
        rng = np.random.default_rng(3)
        step = 1e-5 * rng.normal(size=problem.surfaces[0].size)
        still = np.zeros(problem.layout.columns)
        ends = [
            evaluate(problem, problem.retract(state, [s], still)).frames[0] for s in (step, -step)
        ]
        same = ends[0].faces == ends[1].faces
        exact = (lin.J_surface * step[lin.triangles].T).sum(1)[:, same]
        numeric = (ends[0].residual - ends[1].residual)[:, same] / 2
        assert same.mean() > 0.9
        assert np.abs(numeric - exact).max() < 1e-4 * np.abs(exact).max()

    def test_record(self, llvm: str) -> None:
        """Oracle: what was written."""
        vertices, faces = lopsided()
        mesh, _ = triangle_mesh(vertices, faces, vertices, np.linalg.norm(vertices, axis=1))
        again = TriangleMesh.from_record(mesh.record())
        values = np.linspace(-0.1, 0.1, mesh.size)
        np.testing.assert_array_equal(again.vertices(values), mesh.vertices(values))

    def test_coarse_mesh_to_look_at(self, llvm: str) -> None:
        """Oracle: vertices of the mesh, and triangles between three of them."""
        vertices, faces = lopsided()
        mesh, _ = triangle_mesh(vertices, faces, vertices, np.linalg.norm(vertices, axis=1))
        kept, coarse = mesh.coarsened(60)
        assert 20 < len(kept) < 120
        assert coarse.min() >= 0
        assert coarse.max() < len(kept)
        assert (np.diff(np.sort(coarse, axis=1), axis=1) > 0).all()


def test_reaches_the_lattice_on_its_own_triangles(
    three_views: Views, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the joint solution on the lattice, and the truth: same focal length and poses within
    half a deviation, shape within a tenth, deviations within a tenth."""
    lattice = calibrate(three_views.maps, three_views.rig(), Options(jackknife=False))

    def on_mesh(*args: object) -> tuple[Problem, State]:
        return as_mesh(*joint_problem(*args))  # type: ignore[arg-type]

    monkeypatch.setattr(pipeline, "joint_problem", on_mesh)
    mesh = calibrate(three_views.maps, three_views.rig(), Options(jackknife=False))
    assert isinstance(Lattice, type)
    first, second = (c.solution.projector.focal for c in (lattice, mesh))
    assert isinstance(first.std, float)
    assert isinstance(second.std, float)
    assert second.value == pytest.approx(first.value, abs=0.5 * first.std)
    assert second.std == pytest.approx(first.std, rel=0.1)
    assert abs(focal_error(mesh.solution)) < 1e-3
    for frame in mesh.solution.frames:
        assert abs(frame_errors(three_views, frame).baseline) < 1e-3
    assert shape_error(mesh) < 1.1 * shape_error(lattice)


def test_a_smooth_sheet_is_as_good_as_on_the_lattice_with_fewer_vertices(llvm: str) -> None:
    """Oracle: the true sheet of the benchmark, in two frames; 0.1 % of focal length.

    It bends so little that noise allows longer edges than the lattice's spacing.
    """
    frames = make_frames(2, 0, pixels=140)
    found = {
        surface: calibrate(frames.maps, frames.rig, Options(surface=surface, jackknife=False))
        for surface in ("mesh", "lattice")
    }
    focal, baseline = errors(frames, found["mesh"])
    assert focal < 0.1
    assert baseline < 0.5
    vertices = [found[surface].surface.vertices for surface in ("mesh", "lattice")]
    off = np.split(sheet_distances(np.concatenate(vertices)), [len(vertices[0])])
    mesh, lattice = (np.sqrt(np.mean(d**2)) for d in off)
    assert mesh < 1.1 * lattice
    assert len(vertices[0]) < len(vertices[1])


@pytest.mark.parametrize(("noise", "bend"), [(4.0, 1.0), (1.0, 4.0), (1.0, 1 / 4)])
def test_edges_grow_with_noise_and_shrink_with_curvature(noise: float, bend: float) -> None:
    """Oracle: the cube root of noise over curvature, between the limits."""
    frames, fine = hollow_sphere(noise=1.0, radius=1.0)
    distances = np.full(len(fine.vertices), 5.0)
    before = edge_lengths(fine, frames, distances, 300.0)
    frames, fine = hollow_sphere(noise=noise, radius=1 / bend)
    after = edge_lengths(fine, frames, distances, 300.0)
    assert np.median(after / before) == pytest.approx(np.cbrt(noise / bend), rel=0.02)
    spacing = 5.0 * frames[0].cell
    for extreme, limit in ((1e6, 2.5), (1e-9, 0.5)):
        frames, fine = hollow_sphere(noise=extreme, radius=1.0)
        at_limit = edge_lengths(fine, frames, distances, 300.0)
        np.testing.assert_allclose(at_limit, limit * spacing, rtol=1e-9)


def hollow_sphere(noise: float, radius: float) -> tuple[list[FrameSolution], FusedMesh]:
    """What one frame found of it alone, as far as edges depend on that, and a mesh of it."""
    mesh = trimesh.creation.icosphere(3, radius)
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces, np.int64)
    count = len(vertices)
    fine = FusedMesh(vertices, faces, -vertices / radius, np.full(count, 3), np.full(count, np.nan))
    alone = SimpleNamespace(
        cell=0.02, points=np.zeros((100, 3)), observations=SimpleNamespace(count=900),
        squared=np.full(900, 2 * np.log(2) * noise**2),
    )  # fmt: skip
    return cast("list[FrameSolution]", [alone]), fine


def shape_error(result: Calibration) -> float:
    """RMS distance along z of a surface from the sheet that the views show, mm."""
    x, y, z = result.surface.vertices.T
    return float(np.sqrt(np.mean((z - relief(x, y)) ** 2)))


def _edges(faces: np.ndarray) -> np.ndarray:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])

"""Rendered coordinates against analytic intersections, their Jacobians against differences."""

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.distortion import BrownDistortion
from mitsuba_endo.geometry.laws import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.cost.linearise import FrameRenderer, SurfaceScene
from mitsuba_endo.solve.unknowns.lattice import lattice_over
from mitsuba_endo.solve.unknowns.plan import SIZES
from mitsuba_endo.solve.unknowns.state import INTRINSICS, State, intrinsics_vector
from tests.rigs import Surface, lopsided_camera, lopsided_fisheye, plane, sphere
from tests.solve.problems import LAWS, POSE, SHEET

MOVED = RigidTransform.of([0.06, -0.04, 0.1], [4.0, -3.0, 2.0])
ALL = tuple(SIZES)
TERMS = 5


def view(
    surface: Surface, law: str, camera: CameraModel, moved: bool, cell: float = 0.04
) -> tuple[FrameRenderer, State]:
    """A renderer of a lattice that samples ``surface``, seen from its centre or from MOVED."""
    rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
    pose = MOVED if moved else RigidTransform.identity()
    lattice = lattice_over(rays, cell, margin=8 if moved else 1)
    scene = SurfaceScene(lattice)
    rho = 1 / surface(lattice.directions)
    rho = lattice.fill(np.isfinite(rho), rho)  # steep rays never meet the sheet
    scene.move(rho)
    model = projector_model(law, 330.0, (250, 205), 1.02, (0.05, -0.03, 0.002, -0.001, 0.01))
    # Central pixels of the moved camera, whose rays stay on the lattice.
    part = np.zeros((camera.height, camera.width), bool)
    part[12:-12:5, 15:-15:4] = True
    renderer = FrameRenderer(scene, rays[part.ravel()], law, at_centre=not moved)
    return renderer, State([rho], [pose], [POSE], [intrinsics_vector(model)])


def rays_of(renderer: FrameRenderer) -> np.ndarray:
    """(N, 3) rays of a renderer."""
    return renderer._direction.numpy().T


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", LAWS)
class TestRendering:
    @pytest.mark.parametrize("moved", [False, True])
    def test_plane(self, law: str, moved: bool):
        """Oracle: ray-plane intersection in closed form; triangles lie in the plane exactly."""
        normal, distance = np.array([0.25, -0.15, 1.0]), 70.0
        camera = lopsided_camera(96, 80)
        renderer, state = view(plane(tuple(normal), distance), law, camera, moved)
        q, range_, faces, hit = renderer.render(state, 0, 0)
        assert hit.all()
        pose = state.world_from_camera[0]
        w = pose.rotate(rays_of(renderer))
        s = (normal[2] * distance - normal @ pose.t) / (w @ normal)
        np.testing.assert_allclose(range_, s, rtol=1e-9)
        model = projector_model(law, 330.0, (250, 205), 1.02, (0.05, -0.03, 0.002, -0.001, 0.01))
        expected = model.project(POSE.apply(s[:, None] * rays_of(renderer)))
        np.testing.assert_allclose(q.T, expected, atol=1e-6)
        assert faces.shape == (len(w),)

    def test_sphere(self, law: str):
        """Oracle: ray-sphere intersection; chords of 0.004 rad cells sag by c^2 / 8 R = 1e-4 mm."""
        camera = lopsided_fisheye(64, 48)
        ball = sphere((5, -3, 25), 50)
        renderer, state = view(ball, law, camera, moved=False, cell=0.02)
        _, range_, _, hit = renderer.render(state, 0, 0)
        assert hit.any()
        expected = ball(rays_of(renderer))
        sag = (0.02 * expected.max()) ** 2 / 8 / 50 * 4
        np.testing.assert_allclose(range_, expected, atol=sag)

    def test_misses(self, law: str):
        """Oracle: rays beside the lattice and points behind the projector are no hits."""
        camera = lopsided_camera(96, 80)
        renderer, state = view(plane((0.25, -0.15, 1.0), 70), law, camera, moved=False)
        aside = np.array([[0.95, 0, np.sqrt(1 - 0.95**2)], [0, 0, -1.0], [0.05, 0.02, 1]])
        aside[2] /= np.linalg.norm(aside[2])
        beside = FrameRenderer(renderer.scene, aside, law, at_centre=True)
        np.testing.assert_array_equal(beside.render(state, 0, 0)[3], [False, False, True])
        behind = state.with_(projector_from_camera=[RigidTransform.of([0, 3.0, 0], [0, 0, 0])])
        assert not renderer.render(behind, 0, 0)[3].any()


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("moved", [False, True])
class TestJacobian:
    """Oracle: central differences of the rendered coordinates; pixels whose triangle changes in
    between have another derivative and are left out."""

    def test_of_every_block(self, law: str, moved: bool):
        renderer, state = view(SHEET, law, lopsided_camera(96, 80), moved)
        lin = renderer.linearise(state, 0, 0, ALL, TERMS)
        column = 0
        for name in ALL:
            for i in range(TERMS if name == "distortion" else SIZES[name]):
                h = {"centre": 1e-2, "camera_pose": 2e-6}.get(name, 1e-5)
                numeric, same = self._difference(
                    renderer, self._shifted(state, name, i, h),
                    self._shifted(state, name, i, -h), 2 * h,
                )  # fmt: skip
                found = lin.J_local[:, column][:, same]
                assert same.mean() > 0.95
                scale = np.abs(numeric).max()
                assert scale > 0
                np.testing.assert_allclose(found, numeric, rtol=1e-4, atol=1e-4 * scale)
                column += 1
        assert column == lin.J_local.shape[1]

    def test_of_the_surface(self, law: str, moved: bool):
        """Oracle: a common factor on all inverse ranges, and single vertices."""
        renderer, state = view(SHEET, law, lopsided_camera(96, 80), moved)
        lin = renderer.linearise(state, 0, 0, ALL, TERMS)
        rho, size = state.rho[0], len(state.rho[0])
        rng = np.random.default_rng(0)
        for direction in (rho, rho * rng.normal(size=size), rho * (rng.random(size) < 0.1)):
            h = 1e-5
            pair = [state.with_(rho=[rho + e * direction]) for e in (h, -h)]
            numeric, same = self._difference(renderer, pair[0], pair[1], 2 * h)
            found = np.einsum("cvn,nv->cn", lin.J_surface, direction[lin.triangles])
            scale = np.abs(numeric).max()
            np.testing.assert_allclose(found[:, same], numeric, rtol=1e-4, atol=1e-4 * scale)

    def _shifted(self, state: State, name: str, i: int, h: float) -> State:
        if name in INTRINSICS:
            vector = state.intrinsics[0].copy()
            vector[INTRINSICS[name].start + i] += h
            return state.with_(intrinsics=[vector])
        key = "world_from_camera" if name == "camera_pose" else "projector_from_camera"
        return state.with_(**{key: [getattr(state, key)[0].perturbed(h * np.eye(6)[i])]})

    def _difference(
        self, renderer: FrameRenderer, plus: State, minus: State, width: float
    ) -> tuple[np.ndarray, np.ndarray]:
        out = []
        for state in (plus, minus):
            # A ray from the lattice's centre keeps its triangle, so a shifted camera needs a cast.
            free = FrameRenderer(renderer.scene, rays_of(renderer), renderer.law, at_centre=False)
            free.scene.move(state.rho[0])
            out.append(free.render(state, 0, 0))
        same = (out[0][2] == out[1][2]) & out[0][3] & out[1][3]
        return ((out[0][0] - out[1][0]) / width)[:, same], same


def test_distortion_enters_the_rendering(llvm: str):
    """Oracle: the projector model with and without it differ by more than a pixel."""
    renderer, state = view(SHEET, "pinhole", lopsided_camera(96, 80), moved=False)
    plain = state.intrinsics[0].copy()
    plain[INTRINSICS["distortion"]] = 0
    q = renderer.render(state, 0, 0)[0]
    without = renderer.render(state.with_(intrinsics=[plain]), 0, 0)[0]
    model = projector_model("pinhole", 330.0, (250, 205), 1.02)
    bent = model.with_(distortion=BrownDistortion((0.05, -0.03, 0.002, -0.001, 0.01)))
    s = renderer.render(state, 0, 0)[1]
    X = POSE.apply(s[:, None] * rays_of(renderer))
    np.testing.assert_allclose((q - without).T, bent.project(X) - model.project(X), atol=1e-6)
    assert np.abs(q - without).max() > 1

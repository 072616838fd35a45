"""Rendered coordinates against analytic intersections, their Jacobians against differences."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.geometry.brown_distortion import BrownDistortion
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.solve.costs.differentiable_renderer import FrameRenderer, SurfaceScene
from mitsuba_endo.solve.surfaces.inverse_range_lattice import lattice_over
from mitsuba_endo.solve.unknowns.block import BLOCKS
from mitsuba_endo.solve.unknowns.gauge import Gauge
from mitsuba_endo.solve.unknowns.layout import Layout, make_layout
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import Surface, lopsided_camera, lopsided_fisheye, plane, sphere
from tests.solve.problems import POSE, PROJECTION_MODELS, SHEET, rig_file, small_rig

MOVED = RigidTransform.of([0.06, -0.04, 0.1], [4.0, -3.0, 2.0])
DISTORTION = (0.05, -0.03, 0.002, -0.001, 0.01)


def everything_free(camera: CameraModel) -> Layout:
    """The layout of one frame in which nothing is known, not even where the camera is."""
    changes = {
        "camera": Camera.from_model(camera), "projector": {"distortion": list(DISTORTION)},
        "share": dict.fromkeys(BLOCKS, "shared"),
    }  # fmt: skip
    layout = make_layout(rig_file(small_rig("pinhole"), **changes), 1)
    return replace(layout, gauge=Gauge(world=-1, unit_lengths=frozenset()))


def view(
    surface: Surface, law: str, camera: CameraModel, moved: bool, cell: float = 0.04
) -> tuple[FrameRenderer, State, Layout]:
    """A renderer of a lattice that samples ``surface``, seen from its centre or from MOVED."""
    rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
    pose = MOVED if moved else RigidTransform.identity()
    lattice = lattice_over(rays, cell, margin=8 if moved else 1)
    rho = 1 / surface(lattice.directions)
    rho = lattice.fill(np.isfinite(rho), rho)  # steep rays never meet the sheet
    # Central pixels of the moved camera, whose rays stay on the lattice.
    part = np.zeros((camera.height, camera.width), bool)
    part[12:-12:5, 15:-15:4] = True
    pixels = camera.pixel_grid()[part]
    scene = SurfaceScene(lattice, rho)
    renderer = FrameRenderer(scene, camera, pixels, 0, 0, law, rays_stay=not moved)
    layout = everything_free(camera)
    values = {
        "camera_pose": [pose], "projector_pose": [POSE], "focal": [np.log([330.0])],
        "centre": [np.array([250.0, 205.0])], "aspect": [np.log([1.02])],
        "distortion": [np.array(DISTORTION)],
    }  # fmt: skip
    return renderer, layout.state([rho], values), layout


def rays_of(renderer: FrameRenderer) -> np.ndarray:
    """(N, 3) rays of a renderer."""
    return renderer._rays.numpy().T


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", PROJECTION_MODELS)
class TestRendering:
    @pytest.mark.parametrize("moved", [False, True])
    def test_plane(self, law: str, moved: bool):
        """Oracle: ray-plane intersection in closed form; triangles lie in the plane exactly."""
        normal, distance = np.array([0.25, -0.15, 1.0]), 70.0
        camera = lopsided_camera(96, 80)
        renderer, state, _ = view(plane(tuple(normal), distance), law, camera, moved)
        seen = renderer.render(state)
        assert seen.hit.all()
        pose = state.camera_poses[0]
        w = pose.rotate(rays_of(renderer))
        s = (normal[2] * distance - normal @ pose.t) / (w @ normal)
        np.testing.assert_allclose(seen.distance, s, rtol=1e-9)
        model = projector_model(law, 330.0, (250, 205), 1.02, DISTORTION)
        expected = model.project(POSE.apply(s[:, None] * rays_of(renderer)))
        np.testing.assert_allclose(seen.q.T, expected, atol=1e-6)
        assert seen.faces.shape == (len(w),)

    def test_sphere(self, law: str):
        """Oracle: ray-sphere intersection; chords of 0.004 rad cells sag by c^2 / 8 R = 1e-4 mm."""
        camera = lopsided_fisheye(64, 48)
        ball = sphere((5, -3, 25), 50)
        renderer, state, _ = view(ball, law, camera, moved=False, cell=0.02)
        seen = renderer.render(state)
        assert seen.hit.any()
        expected = ball(rays_of(renderer))
        sag = (0.02 * expected.max()) ** 2 / 8 / 50 * 4
        np.testing.assert_allclose(seen.distance, expected, atol=sag)

    def test_misses(self, law: str):
        """Oracle: rays beside the lattice and points behind the projector are no hits."""
        # Equidistant, so that pixels beside the image have rays at any angle.
        K = np.array([[90.0, 0, 45], [0, 92.0, 43], [0, 0, 1]])
        camera = CameraModel("opencv_fisheye", 96, 80, K)
        renderer, state, _ = view(plane((0.25, -0.15, 1.0), 70), law, camera, moved=False)
        aside = np.array([[0.95, 0, np.sqrt(1 - 0.95**2)], [1e-9, 0, -1.0], [0.05, 0.02, 1]])
        aside[2] /= np.linalg.norm(aside[2])
        beside = renderer.at_pixels(camera.project(aside))
        np.testing.assert_allclose(rays_of(beside), aside, atol=1e-9)
        np.testing.assert_array_equal(beside.render(state).hit, [False, False, True])
        away = RigidTransform.of([0, 3.0, 0], [0, 0, 0])
        behind = state.with_value("projector_pose", 0, away)
        assert not renderer.render(behind).hit.any()


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", PROJECTION_MODELS)
@pytest.mark.parametrize("moved", [False, True])
class TestJacobian:
    """Oracle: central differences of the rendered coordinates; pixels whose triangle changes in
    between have another derivative and are left out."""

    def test_of_every_block(self, law: str, moved: bool):
        renderer, state, layout = view(SHEET, law, lopsided_camera(96, 80), moved)
        lin = renderer.linearise(state, layout)
        assert layout.active(0) == tuple(BLOCKS)
        column = 0
        for name in layout.active(0):
            for i in range(layout.widths[name]):
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
        renderer, state, layout = view(SHEET, law, lopsided_camera(96, 80), moved)
        lin = renderer.linearise(state, layout)
        rho, size = state.surfaces[0], len(state.surfaces[0])
        rng = np.random.default_rng(0)
        for direction in (rho, rho * rng.normal(size=size), rho * (rng.random(size) < 0.1)):
            h = 1e-5
            pair = [state.with_surfaces(rho + e * direction) for e in (h, -h)]
            numeric, same = self._difference(renderer, pair[0], pair[1], 2 * h)
            found = np.einsum("cvn,nv->cn", lin.J_surface, direction[lin.triangles])
            scale = np.abs(numeric).max()
            np.testing.assert_allclose(found[:, same], numeric, rtol=1e-4, atol=1e-4 * scale)

    def _shifted(self, state: State, name: str, i: int, h: float) -> State:
        value = state.values[name][0]
        if isinstance(value, RigidTransform):
            return state.with_value(name, 0, value.perturbed(h * np.eye(6)[i]))
        return state.with_value(name, 0, value + h * np.eye(len(value))[i])

    def _difference(
        self, renderer: FrameRenderer, plus: State, minus: State, width: float
    ) -> tuple[np.ndarray, np.ndarray]:
        out = []
        for state in (plus, minus):
            # A ray from the lattice's centre keeps its triangle, so a shifted camera needs a cast.
            free = FrameRenderer(
                renderer.scene, renderer.camera, renderer._pixels, 0, 0, renderer.law,
                rays_stay=False,
            )  # fmt: skip
            free.scene.move(state.surfaces[0])
            out.append(free.render(state))
        same = (out[0].faces == out[1].faces) & out[0].hit & out[1].hit
        return ((out[0].q - out[1].q) / width)[:, same], same


def test_distortion_enters_the_rendering(llvm: str):
    """Oracle: the projector model with and without it differ by more than a pixel."""
    renderer, state, _ = view(SHEET, "pinhole", lopsided_camera(96, 80), moved=False)
    seen = renderer.render(state)
    without = renderer.render(state.with_value("distortion", 0, np.zeros(5))).q
    model = projector_model("pinhole", 330.0, (250, 205), 1.02)
    bent = model.with_(distortion=BrownDistortion(DISTORTION))
    X = POSE.apply(seen.distance[:, None] * rays_of(renderer))
    np.testing.assert_allclose((seen.q - without).T, bent.project(X) - model.project(X), atol=1e-6)
    assert np.abs(seen.q - without).max() > 1

"""The layout: where every unknown stands, steps, and plans that contradict themselves."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CAMERAS
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.consistency import MIN_CORRESPONDENCES
from mitsuba_endo.records.rig import MAX_PROJECTOR_DISTORTION, Camera
from mitsuba_endo.solve.costs.objective import make_problem
from mitsuba_endo.solve.surfaces.inverse_range_lattice import Lattice, lattice_over
from mitsuba_endo.solve.unknowns.block import BLOCKS
from mitsuba_endo.solve.unknowns.layout import Layout, make_layout
from mitsuba_endo.solve.unknowns.state import State
from tests.rigs import lopsided_camera
from tests.solve.problems import POSE, rig_file, small_rig

RIG = small_rig("pinhole")
TURNED = RigidTransform.of([0.1, 0.2, -0.1], [3.0, -1.0, 0.4])


def layout_of(frames: int, **changes: Any) -> Layout:
    return make_layout(rig_file(RIG, **changes), frames)


def lattice() -> Lattice:
    rays = lopsided_camera(96, 80).grid_rays[::8, ::8].reshape(-1, 3)
    return lattice_over(rays, 0.1)


def state_of(layout: Layout) -> State:
    """Values of every owner that are their own, whatever the rig says."""
    of_frames = {
        "camera_pose": [RigidTransform.identity(), TURNED, TURNED],
        "projector_pose": [POSE, TURNED, POSE @ TURNED],
        "focal": [np.array([5.8])] * 3,
        "centre": [np.array([250.0, 205.0])] * 3,
        "aspect": [np.array([0.01])] * 3,
        "distortion": [np.array([0.02, 0.03])] * 3,
    }
    values = {
        name: tuple(of_frames.get(name, [layout.given[name]] * 3)[k] for k in sorted(set(owners)))
        for name, owners in layout.owners.items()
    }
    surfaces = [np.full(lattice().size, 0.1) + 0.01 * i for i in range(layout.surfaces)]
    return State(tuple(surfaces), values, layout.owners)


class TestColumns:
    def test_one_frame(self):
        """Oracle: rotation 3, direction of translation 2, log f 1."""
        layout = layout_of(1)
        assert layout.slots == {("projector_pose", 0): slice(0, 5), ("focal", 0): slice(5, 6)}
        assert layout.columns == 6
        assert layout.active(0) == ("projector_pose", "focal")

    @pytest.mark.parametrize("model", CAMERAS)
    def test_the_fewest_correspondences_are_more_than_all_unknowns(self, model: str):
        """Oracle: with fewer than so many a map is refused; every block is an unknown."""
        most = CAMERAS[model].max_coefficients[-1]
        camera = {**Camera.from_model(RIG.camera).model_dump(), "model": model,
                  "distortion": [0.0] * most}  # fmt: skip
        own = {n: "per_frame" for n, b in BLOCKS.items() if "per_frame" in b.modes}
        rest = dict.fromkeys(BLOCKS.keys() - own.keys(), "shared")
        projector = {"distortion": [0.0] * MAX_PROJECTOR_DISTORTION}
        for frames in (1, 7):
            layout = layout_of(frames, camera=camera, projector=projector, share={**own, **rest})
            assert set(layout.widths) == {name for name, free in layout.free.items() if free}
            assert 0 < layout.columns < 2 * MIN_CORRESPONDENCES * frames

    def test_shared_surface_with_poses_per_frame(self):
        """Oracle: only the first translation's length is held, the first camera is the world."""
        layout = layout_of(3)
        widths = {k: s.stop - s.start for k, s in layout.slots.items()}
        assert widths == {
            ("camera_pose", 1): 6, ("camera_pose", 2): 6, ("projector_pose", 0): 5,
            ("projector_pose", 1): 6, ("projector_pose", 2): 6, ("focal", 0): 1,
        }  # fmt: skip
        assert layout.active(0) == ("projector_pose", "focal")
        assert layout.active(2) == ("camera_pose", "projector_pose", "focal")
        assert layout.slot("focal", 2) == layout.slot("focal", 0)
        assert (layout.surfaces, layout.surface_of[2]) == (1, 0)

    def test_shared_projector(self):
        """Oracle: configuration B of the paper has one pose of five columns."""
        layout = layout_of(3, share={"projector_pose": "shared"})
        assert layout.columns == 2 * 6 + 5 + 1
        assert layout.slot("projector_pose", 2) == layout.slot("projector_pose", 0)

    def test_surfaces_per_frame(self):
        """Oracle: without a common surface every pose of its own has its own unit of length."""
        layout = layout_of(3, share={"surface": "per_frame"})
        assert layout.columns == 3 * 5 + 1
        assert layout.surface_of == (0, 1, 2)
        shared = layout_of(3, share={"surface": "per_frame", "projector_pose": "shared"})
        assert shared.columns == 6

    def test_intrinsics(self):
        """Oracle: log f, centre 2, log aspect, at least two terms of distortion."""
        share = {"focal": "per_frame", "centre": "shared", "aspect": "shared",
                 "distortion": "shared", "surface": "per_frame"}  # fmt: skip
        layout = layout_of(2, share=share)
        assert layout.columns == 2 * 5 + 2 + 2 + 1 + 2
        three = layout_of(2, share=share, projector={"distortion": [0.1, 0.0, 0.0]})
        assert three.columns == layout.columns + 1

    def test_given_focal_and_pose(self):
        """Oracle: nothing is left but the surface."""
        projector = {"focal": 330.0, "pose": {"R": [0, 0, 0.1], "t": [-6.0, 1, 0]}}
        layout = layout_of(1, projector=projector, share={"projector_pose": "fixed"})
        assert layout.columns == 0
        assert not layout.gauge.holds_length("projector_pose", 0)
        assert layout.local_from_global(state_of(layout), 0).shape == (0, 0)


def local_step(layout: Layout, state: State, name: str, frame: int, step: np.ndarray) -> np.ndarray:
    """The step of one value for that of all unknowns."""
    slot = layout.slot(name, frame)
    assert slot is not None
    return layout.tangent_map(state, name, layout.owner(name, frame)) @ step[slot]


def test_tangent_maps_take_every_unknown_to_its_place():
    """Oracle: local = T global equals the step of each block, with and without a held length."""
    layout = layout_of(3)
    state = state_of(layout)
    step = np.random.default_rng(0).normal(size=layout.columns)
    for frame in range(3):
        local = layout.local_from_global(state, frame) @ step
        parts = [local_step(layout, state, name, frame, step) for name in layout.active(frame)]
        np.testing.assert_allclose(local, np.concatenate(parts))
        for name, part in zip(layout.active(frame), parts, strict=True):
            np.testing.assert_allclose(local[layout.rows(name, frame)], part)
    first = local_step(layout, state, "projector_pose", 0, step)
    assert abs(first[3:] @ POSE.t) < 1e-12


class TestContradictions:
    @pytest.mark.parametrize(
        ("changes", "frames", "where"),
        [
            ({"share": {"surface": "fixed"}}, 1, "share.surface"),
            ({"share": {"camera_pose": "shared"}}, 2, "share.camera_pose"),
            ({"share": {"projector_pose": "fixed"}}, 1, "share.projector_pose"),
            ({"share": {"focal": "fixed"}}, 1, "share.focal"),
            ({"share": {"camera_pose": "fixed"}}, 2, "share.camera_pose"),
            ({"share": {"projector_pose": "shared"}, "drift": {"roll_deg": 1.0}}, 2, "drift"),
        ],
    )
    def test_is_refused(self, changes: dict, frames: int, where: str):
        """Oracle: an InputError that names the field and says what to do."""
        with pytest.raises(InputError) as caught:
            layout_of(frames, **changes)
        assert caught.value.where == where
        assert caught.value.todo

    def test_is_none_with_one_frame(self):
        """Oracle: one camera that does not move contradicts nothing."""
        assert layout_of(1, share={"camera_pose": "fixed"}).columns == 6
        assert layout_of(1, share={"camera_pose": "shared"}).columns == 6


class TestStepping:
    @pytest.mark.usefixtures("llvm")
    def test_moves_every_unknown_by_its_step(self):
        """Oracle: the tangent exp([w]) R, t + dt; addition for logarithms and centre."""
        layout = layout_of(2, share={"centre": "shared"})
        state = state_of(layout)
        problem = make_problem([], [lattice()], state, layout, "pinhole", [])
        step = np.zeros(layout.columns)
        camera, second = layout.slots["camera_pose", 1], layout.slots["projector_pose", 1]
        focal, centre = layout.slots["focal", 0], layout.slots["centre", 0]
        step[camera], step[second] = [0.1, 0, 0, 1, 2, 3], [0, 0.2, 0, 0.3, 0, 0]
        step[focal], step[centre] = 0.05, [2, -3]
        new = problem.retract(state, [np.full(lattice().size, 0.01)], step)
        np.testing.assert_allclose(new.surfaces[0], state.surfaces[0] + 0.01)
        np.testing.assert_allclose(new.camera_poses[1].t, TURNED.t + np.array([1, 2, 3]))
        turn = RigidTransform.of([0, 0.2, 0], [0, 0, 0]).R
        np.testing.assert_allclose(new.projector_poses[1].R, turn @ TURNED.R)
        moved = {"focal": [0.05], "centre": [2, -3], "aspect": [0], "distortion": [0, 0]}
        for k in range(2):
            for name, change in moved.items():
                np.testing.assert_allclose(new.at(name, k), state.at(name, k) + change)
        np.testing.assert_array_equal(new.camera_poses[0].matrix(), np.eye(4))

    def test_keeps_the_held_length(self):
        """Oracle: |t| before; its direction follows the step to first order."""
        layout = layout_of(1)
        state = state_of(layout)
        step = np.array([0, 0, 0, 0.8, -0.5, 0])
        t = layout.retract(state, step).projector_poses[0].t
        np.testing.assert_allclose(np.linalg.norm(t), np.linalg.norm(POSE.t), rtol=1e-14)
        local = local_step(layout, state, "projector_pose", 0, step)
        np.testing.assert_allclose(t, (POSE.t + local[3:]) * (t[0] / (POSE.t + local[3:])[0]))

    def test_keeps_inverse_ranges_positive(self):
        """Oracle: no vertex is farther than twenty medians, whatever the step."""
        surface = lattice()
        change = np.linspace(-0.3, 0.3, surface.size)
        rho = surface.retract(np.full(surface.size, 0.1), change)
        assert (rho >= 0.1 / 20 - 1e-15).all()
        np.testing.assert_allclose(rho[change > -0.09], 0.1 + change[change > -0.09])

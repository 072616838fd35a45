"""The sharing plan: where every unknown stands, and plans that contradict themselves."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.solve.unknowns.plan import Plan, make_plan
from mitsuba_endo.solve.unknowns.state import State
from mitsuba_endo.solve.unknowns.stepping import apply_step
from tests.solve.problems import POSE, rig_file, small_rig

RIG = small_rig("pinhole")
TURNED = RigidTransform.of([0.1, 0.2, -0.1], [3.0, -1.0, 0.4])


def plan_of(frames: int, **changes: Any) -> Plan:
    return make_plan(rig_file(RIG, **changes), frames)


def state_of(frames: int, surfaces: int = 1) -> State:
    return State(
        [np.full(10, 0.1) + 0.01 * i for i in range(surfaces)],
        [RigidTransform.identity(), *[TURNED] * (frames - 1)],
        [POSE, TURNED, POSE @ TURNED][:frames],
        [np.array([5.8, 250, 205, 0.01, 0.02, 0.03, 0, 0, 0]) for _ in range(frames)],
    )


class TestColumns:
    def test_one_frame(self):
        """Oracle: rotation 3, direction of translation 2, log f 1."""
        plan = plan_of(1)
        assert plan.slots == {("projector_pose", 0): slice(0, 5), ("focal", 0): slice(5, 6)}
        assert plan.columns == 6
        assert plan.active(0) == ("projector_pose", "focal")

    def test_shared_surface_with_poses_per_frame(self):
        """Oracle: only the first translation's length is held, the first camera is the world."""
        plan = plan_of(3)
        widths = {k: s.stop - s.start for k, s in plan.slots.items()}
        assert widths == {
            ("camera_pose", 1): 6, ("camera_pose", 2): 6, ("projector_pose", 0): 5,
            ("projector_pose", 1): 6, ("projector_pose", 2): 6, ("focal", 0): 1,
        }  # fmt: skip
        assert plan.active(0) == ("projector_pose", "focal")
        assert plan.active(2) == ("camera_pose", "projector_pose", "focal")
        assert plan.slot("focal", 2) == plan.slot("focal", 0)
        assert (plan.surfaces, plan.surface_of(2)) == (1, 0)

    def test_shared_projector(self):
        """Oracle: configuration B of the paper has one pose of five columns."""
        plan = plan_of(3, share={"projector_pose": "shared"})
        assert plan.columns == 2 * 6 + 5 + 1
        assert plan.slot("projector_pose", 2) == plan.slot("projector_pose", 0)

    def test_surfaces_per_frame(self):
        """Oracle: without a common surface every pose of its own has its own unit of length."""
        plan = plan_of(3, share={"surface": "per_frame"})
        assert plan.columns == 3 * 5 + 1
        assert [plan.surface_of(k) for k in range(3)] == [0, 1, 2]
        shared = plan_of(3, share={"surface": "per_frame", "projector_pose": "shared"})
        assert shared.columns == 6

    def test_intrinsics(self):
        """Oracle: log f, centre 2, log aspect, at least two terms of distortion."""
        share = {"focal": "per_frame", "centre": "shared", "aspect": "shared",
                 "distortion": "shared", "surface": "per_frame"}  # fmt: skip
        plan = plan_of(2, share=share)
        assert plan.columns == 2 * 5 + 2 + 2 + 1 + 2
        three = plan_of(2, share=share, projector={"distortion": [0.1, 0.0, 0.0]})
        assert three.columns == plan.columns + 1

    def test_given_focal_and_pose(self):
        """Oracle: nothing is left but the surface."""
        projector = {"focal": 330.0, "pose": {"R": [0, 0, 0.1], "t": [-6.0, 1, 0]}}
        plan = plan_of(1, projector=projector, share={"projector_pose": "fixed"})
        assert plan.columns == 0
        assert not plan.free_scale
        assert plan.local_to_global(state_of(1), 0).shape == (0, 0)


def test_charts_map_every_local_column_to_its_slot():
    """Oracle: local = T global equals the step of each block, with and without a held length."""
    plan, state = plan_of(3), state_of(3)
    step = np.random.default_rng(0).normal(size=plan.columns)
    for frame in range(3):
        local = plan.local_to_global(state, frame) @ step
        parts = [plan.step_local(state, name, frame, step) for name in plan.active(frame)]
        assert all(p is not None for p in parts)
        np.testing.assert_allclose(local, np.concatenate([p for p in parts if p is not None]))
    first = plan.step_local(state, "projector_pose", 0, step)
    assert first is not None
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
            plan_of(frames, **changes)
        assert caught.value.where == where
        assert caught.value.todo

    def test_is_none_with_one_frame(self):
        """Oracle: one camera that does not move contradicts nothing."""
        assert plan_of(1, share={"camera_pose": "fixed"}).columns == 6
        assert plan_of(1, share={"camera_pose": "shared"}).columns == 6


class TestStepping:
    def test_moves_every_unknown_by_its_step(self):
        """Oracle: the chart exp([w]) R, t + dt; addition for logarithms and centre."""
        plan, state = plan_of(2, share={"centre": "shared"}), state_of(2)
        step = np.zeros(plan.columns)
        camera, second = plan.slots["camera_pose", 1], plan.slots["projector_pose", 1]
        focal, centre = plan.slots["focal", 0], plan.slots["centre", 0]
        step[camera], step[second] = [0.1, 0, 0, 1, 2, 3], [0, 0.2, 0, 0.3, 0, 0]
        step[focal], step[centre] = 0.05, [2, -3]
        new = apply_step(plan, state, [np.full(10, 0.01)], step)
        np.testing.assert_allclose(new.rho[0], state.rho[0] + 0.01)
        np.testing.assert_allclose(new.world_from_camera[1].t, TURNED.t + np.array([1, 2, 3]))
        turn = RigidTransform.of([0, 0.2, 0], [0, 0, 0]).R
        np.testing.assert_allclose(new.projector_from_camera[1].R, turn @ TURNED.R)
        for k in range(2):
            expected = state.intrinsics[k] + [0.05, 2, -3, 0, 0, 0, 0, 0, 0]
            np.testing.assert_allclose(new.intrinsics[k], expected)
        np.testing.assert_array_equal(new.world_from_camera[0].matrix(), np.eye(4))

    def test_keeps_the_held_length(self):
        """Oracle: |t| before; its direction follows the step to first order."""
        plan, state = plan_of(1), state_of(1)
        step = np.array([0, 0, 0, 0.8, -0.5, 0])
        t = apply_step(plan, state, [np.zeros(10)], step).projector_from_camera[0].t
        np.testing.assert_allclose(np.linalg.norm(t), np.linalg.norm(POSE.t), rtol=1e-14)
        local = plan.step_local(state, "projector_pose", 0, step)
        assert local is not None
        np.testing.assert_allclose(t, (POSE.t + local[3:]) * (t[0] / (POSE.t + local[3:])[0]))

    def test_keeps_inverse_ranges_positive(self):
        """Oracle: no vertex is farther than twenty medians, whatever the step."""
        plan, state = plan_of(1), state_of(1)
        change = np.linspace(-0.3, 0.3, 10)
        rho = apply_step(plan, state, [change], np.zeros(6)).rho[0]
        assert (rho >= 0.1 / 20 - 1e-15).all()
        np.testing.assert_allclose(rho[change > -0.09], 0.1 + change[change > -0.09])

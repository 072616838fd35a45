"""The random-walk prior on the projector pose."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.solve.cost.drift import drift_prior, step_between
from mitsuba_endo.solve.cost.objective import GlobalTerm
from mitsuba_endo.solve.unknowns.plan import Plan, make_plan
from mitsuba_endo.solve.unknowns.state import INTRINSICS, State
from mitsuba_endo.solve.unknowns.stepping import apply_step

BASELINE = 6.0
DRIFT = {"insertion_mm": 0.4, "lateral_mm": 0.1, "roll_deg": 1.5, "tilt_deg": 0.3}


def rig(drift: dict[str, float], **changes: Any) -> Rig:
    data: dict[str, Any] = {
        "camera": {"width": 64, "height": 48, "K": [[50, 0, 31], [0, 52, 24], [0, 0, 1]]},
        "projector": {"width": 512, "height": 400},
        "scale": {"baseline": BASELINE},
        "drift": drift,
    }
    return Rig.model_validate({**data, **changes})


def state() -> State:
    """Three frames whose projector has moved, in baselines."""
    rng = np.random.default_rng(4)
    poses = [
        RigidTransform.of([0.1, -0.3, *rng.normal(0.2, 0.02, 1)], [-0.9, 0.3, 0.3])
        for _ in range(3)
    ]
    moved = [RigidTransform(p.R, p.t + rng.normal(0, 0.03, 3)) for p in poses]
    intrinsics = np.zeros(max(s.stop for s in INTRINSICS.values()))
    intrinsics[INTRINSICS["focal"]] = np.log(400.0)
    return State([np.ones(4)], [RigidTransform.identity()] * 3, moved, [intrinsics] * 3)


def prior_of(record: Rig) -> tuple[Plan, GlobalTerm]:
    plan = make_plan(record, 3)
    term = drift_prior(record, plan)
    assert term is not None
    return plan, term


def stepped(plan: Plan, at: State, step: np.ndarray) -> State:
    return apply_step(plan, at, [np.zeros(len(at.rho[0]))], step)


def test_gradient_equals_differences() -> None:
    """Oracle: central differences of the value over the plan's own steps."""
    plan, term = prior_of(rig(DRIFT))
    at, h = state(), 1e-5
    _, gradient, _ = term(at)
    numeric = np.array(
        [
            (term(stepped(plan, at, h * e))[2] - term(stepped(plan, at, -h * e))[2]) / (2 * h)
            for e in np.eye(plan.columns)
        ]
    )
    assert np.abs(numeric).max() > 1
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())


def test_hessian_is_that_of_the_steps() -> None:
    """Oracle: J^T J with J the differences of the whitened steps themselves."""
    plan, term = prior_of(rig(DRIFT))
    at, h = state(), 1e-6
    angle = np.radians([DRIFT["tilt_deg"], DRIFT["tilt_deg"], DRIFT["roll_deg"]])
    length = np.array([DRIFT["lateral_mm"], DRIFT["lateral_mm"], DRIFT["insertion_mm"]]) / BASELINE
    spread = np.concatenate([angle, length])

    def steps(s: State) -> np.ndarray:
        p = s.projector_from_camera
        return np.concatenate([step_between(p[k], p[k + 1]) / spread for k in range(2)])

    J = np.array(
        [
            (steps(stepped(plan, at, h * e)) - steps(stepped(plan, at, -h * e))) / (2 * h)
            for e in np.eye(plan.columns)
        ]
    ).T
    hessian, gradient, value = term(at)
    scale = np.abs(hessian).max()
    np.testing.assert_allclose(hessian, J.T @ J, atol=1e-6 * scale)
    np.testing.assert_allclose(gradient, J.T @ steps(at), atol=1e-6 * np.abs(gradient).max())
    assert value == pytest.approx((steps(at) ** 2).sum() / 2)


def test_axes_are_the_projectors() -> None:
    """Oracle: a pose moved along, and turned about, the projector's own axis z."""
    first = state().projector_from_camera[0]
    moved = RigidTransform.of([0, 0, 0.01], [0, 0, 0.25]) @ first
    np.testing.assert_allclose(step_between(first, moved), [0, 0, 0.01, 0, 0, 0.25], atol=1e-12)


def test_roll_alone_leaves_the_rest_free() -> None:
    """Oracle: two steps, of one component each; none of it acts on lengths."""
    plan, term = prior_of(rig({"roll_deg": 1.0}, scale={}))
    hessian, _, _ = term(state())
    assert np.linalg.matrix_rank(hessian, tol=1e-6 * np.abs(hessian).max()) == 2
    assert plan.columns > 15


def test_poses_alike_cost_nothing() -> None:
    """Oracle: zero steps."""
    _, term = prior_of(rig(DRIFT))
    at = state()
    still = at.with_(projector_from_camera=[at.projector_from_camera[0]] * 3)
    _, gradient, value = term(still)
    assert value == pytest.approx(0, abs=1e-20)
    np.testing.assert_allclose(gradient, 0, atol=1e-9)


def test_one_frame_has_no_steps() -> None:
    record = rig(DRIFT)
    assert drift_prior(record, make_plan(record, 1)) is None


def test_millimetres_need_a_unit() -> None:
    with pytest.raises(InputError, match="unit of length"):
        prior_of(rig({"insertion_mm": 1.0}, scale={}))


def test_drift_of_a_shared_pose_is_a_contradiction() -> None:
    with pytest.raises(InputError, match="not per frame"):
        make_plan(rig(DRIFT, share={"projector_pose": "shared"}), 3)

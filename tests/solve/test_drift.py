"""The random-walk prior on the projector pose."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.costs.drift import DriftTerm, drift, step_between
from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.costs.registry import priors_of
from mitsuba_endo.solve.costs.term import Gradient
from mitsuba_endo.solve.elimination.normal_equations import NormalEquations
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.layout import Layout, make_layout
from mitsuba_endo.solve.unknowns.state import State
from tests.solve.views import POSE, look, relief_surface, steps

BASELINE = 6.0
DRIFT = {"insertion_mm": 0.4, "lateral_mm": 0.1, "roll_deg": 1.5, "tilt_deg": 0.3}


def rig(spreads: dict[str, float], **changes: Any) -> Rig:
    data: dict[str, Any] = {
        "camera": {"width": 64, "height": 48, "K": [[50, 0, 31], [0, 52, 24], [0, 0, 1]]},
        "projector": {"width": 512, "height": 400},
        "scale": {"baseline": BASELINE},
        "drift": spreads,
    }
    return Rig.model_validate({**data, **changes})


def poses() -> list[RigidTransform]:
    """Three frames whose projector has moved, in baselines."""
    rng = np.random.default_rng(4)
    start = [
        RigidTransform.of([0.1, -0.3, *rng.normal(0.2, 0.02, 1)], [-0.9, 0.3, 0.3])
        for _ in range(3)
    ]
    return [RigidTransform(p.R, p.t + rng.normal(0, 0.03, 3)) for p in start]


def state(layout: Layout, of_projector: list[RigidTransform]) -> State:
    of_frames = {
        "camera_pose": [RigidTransform.identity()] * 3,
        "projector_pose": of_projector,
        "focal": [np.log([400.0])] * 3,
    }
    return layout.state([np.ones(4)], of_frames)


def prior_of(record: Rig) -> tuple[Layout, DriftTerm]:
    layout = make_layout(record, 3)
    (term,) = priors_of(record, layout)
    assert isinstance(term, DriftTerm)
    return layout, term


def parts(term: DriftTerm, at: State) -> tuple[np.ndarray, np.ndarray, float]:
    """Hessian, gradient and value, in noise variances; at a noise of two pixels."""
    noise = NoiseScale(2.0, "tukey")
    normal = NormalEquations.empty([], term.layout.columns)
    term.accumulate(normal, term.evaluate(at), noise)
    alone = Gradient([], np.zeros(term.layout.columns))
    term.accumulate_gradient(alone, at, noise)
    np.testing.assert_allclose(alone.unknowns, normal.g, rtol=1e-12)
    return normal.D / 4, normal.g / 4, term.cost(term.evaluate(at), noise) / 4


def test_gradient_equals_differences() -> None:
    """Oracle: central differences of the value over the layout's own steps."""
    layout, term = prior_of(rig(DRIFT))
    at, h = state(layout, poses()), 1e-5
    _, gradient, _ = parts(term, at)

    def value(step: np.ndarray) -> float:
        return parts(term, layout.retract(at, step))[2]

    numeric = np.array([(value(h * e) - value(-h * e)) / (2 * h) for e in np.eye(layout.columns)])
    assert np.abs(numeric).max() > 1
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-5 * np.abs(numeric).max())


def test_hessian_is_that_of_the_steps() -> None:
    """Oracle: J^T J with J the differences of the whitened steps themselves."""
    layout, term = prior_of(rig(DRIFT))
    at, h = state(layout, poses()), 1e-6
    angle = np.radians([DRIFT["tilt_deg"], DRIFT["tilt_deg"], DRIFT["roll_deg"]])
    length = np.array([DRIFT["lateral_mm"], DRIFT["lateral_mm"], DRIFT["insertion_mm"]]) / BASELINE
    spread = np.concatenate([angle, length])

    def steps(s: State) -> np.ndarray:
        p = s.projector_poses
        return np.concatenate([step_between(p[k], p[k + 1]) / spread for k in range(2)])

    J = np.array(
        [
            (steps(layout.retract(at, h * e)) - steps(layout.retract(at, -h * e))) / (2 * h)
            for e in np.eye(layout.columns)
        ]
    ).T
    hessian, gradient, value = parts(term, at)
    scale = np.abs(hessian).max()
    np.testing.assert_allclose(hessian, J.T @ J, atol=1e-6 * scale)
    np.testing.assert_allclose(gradient, J.T @ steps(at), atol=1e-6 * np.abs(gradient).max())
    assert value == pytest.approx((steps(at) ** 2).sum() / 2)


def test_axes_are_the_projectors() -> None:
    """Oracle: a pose moved along, and turned about, the projector's own axis z."""
    first = poses()[0]
    moved = RigidTransform.of([0, 0, 0.01], [0, 0, 0.25]) @ first
    np.testing.assert_allclose(step_between(first, moved), [0, 0, 0.01, 0, 0, 0.25], atol=1e-12)


def test_roll_alone_leaves_the_rest_free() -> None:
    """Oracle: two steps, of one component each; none of it acts on lengths."""
    layout, term = prior_of(rig({"roll_deg": 1.0}, scale={}))
    hessian, _, _ = parts(term, state(layout, poses()))
    assert np.linalg.matrix_rank(hessian, tol=1e-6 * np.abs(hessian).max()) == 2
    assert layout.columns > 15


def test_poses_alike_cost_nothing() -> None:
    """Oracle: zero steps."""
    layout, term = prior_of(rig(DRIFT))
    _, gradient, value = parts(term, state(layout, [poses()[0]] * 3))
    assert value == pytest.approx(0, abs=1e-20)
    np.testing.assert_allclose(gradient, 0, atol=1e-9)


def test_one_frame_has_no_steps() -> None:
    record = rig(DRIFT)
    assert drift(record, make_layout(record, 1)) is None


def test_millimetres_need_a_unit() -> None:
    with pytest.raises(InputError, match="unit of length"):
        prior_of(rig({"insertion_mm": 1.0}, scale={}))


def test_drift_of_a_shared_pose_is_a_contradiction() -> None:
    with pytest.raises(InputError, match="not per frame"):
        make_layout(rig(DRIFT, share={"projector_pose": "shared"}), 3)


@pytest.mark.usefixtures("llvm")
def test_deviations_fall_with_the_spread() -> None:
    """Oracle: knowing more never makes deviations larger; with almost no spread the projector's
    steps are known to the spread. Noise 0.1 px, a projector that does not move."""
    views = look(relief_surface(), steps(3), [POSE] * 3)
    stds, moved = [], []
    for spread in (None, 1.0, 0.01, 0.001):
        drift = {f"{n}_mm": spread for n in ("insertion", "lateral")}
        drift |= {f"{n}_deg": spread for n in ("roll", "tilt")}
        changes = {} if spread is None else {"drift": drift}
        solution = calibrate(views.maps, views.rig(**changes), Options(jackknife=False)).solution
        stds.append([f.projector_from_camera.std for f in solution.frames])
        poses = [f.projector_from_camera.to_transform() for f in solution.frames]
        assert all(p is not None for p in poses)
        moved.append([step_between(a, b) for a, b in pairwise(poses)])  # type: ignore[arg-type]
    for wide, narrow in pairwise(np.array(stds)):
        assert (narrow <= 1.001 * wide).all()
    # Across the axis three frames then know one pose together; along it the surface decides.
    assert (np.array(stds)[-1, :, 3] < 0.7 * np.array(stds)[0, :, 3])[1:].all()
    # Ten standard deviations of the prior: data pull by what is left of their noise.
    assert np.abs(np.array(moved[-1])[:, 3:]).max() < 0.01

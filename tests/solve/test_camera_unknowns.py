"""Camera intrinsics as unknowns. Oracles: finite differences, the true camera, the prior."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.validation import validate
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.costs.gaussian_prior import GaussianPriorTerm
from mitsuba_endo.solve.costs.objective import evaluate
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.layout import make_layout
from tests.rigs import cast, lopsided_fisheye, with_noise
from tests.solve.problems import (
    POSE,
    PROJECTION_MODELS,
    SHEET,
    map_of,
    problem_of,
    rig_file,
    small_rig,
)

pytestmark = pytest.mark.usefixtures("llvm")
ALL = {"camera_focal": "shared", "camera_centre": "shared", "camera_distortion": "shared"}
PRIOR = {"K_std": [1.0, 1.1, 0.8, 0.9], "distortion_std": 0.01}


def camera_of(rig: Any, wrong: float = 0.0, **changes: Any) -> dict[str, Any]:
    """The rig's camera as a file gives it, its focal lengths too long by a share."""
    record = Camera.from_model(rig.camera).model_dump()
    K = np.array(record["K"]) * np.array([[1 + wrong, 1, 1], [1, 1 + wrong, 1], [1, 1, 1]])
    return {**record, "K": K.tolist(), **changes}


@pytest.mark.parametrize("law", PROJECTION_MODELS)
@pytest.mark.parametrize("fisheye", [False, True])
def test_derivatives(law: str, fisheye: bool) -> None:
    """Oracle: central differences of the rendered coordinates, pixels that keep their triangle."""
    rig = small_rig(law)
    if fisheye:
        rig = cast(lopsided_fisheye(96, 80), rig.projector, rig.size, POSE, SHEET)
    problem, state = problem_of([rig], rig_file(rig, share=ALL))
    lin = evaluate(problem, state).linearisation(0)
    T = problem.layout.local_from_global(state, 0)
    still = [np.zeros(s.size) for s in problem.surfaces]
    for (name, _), slot in problem.layout.slots.items():
        for i in range(slot.start, slot.stop):
            step = 1e-6 * np.eye(problem.layout.columns)[i]
            ends = [
                evaluate(problem, problem.retract(state, still, s)).frames[0] for s in (step, -step)
            ]
            same = ends[0].faces == ends[1].faces
            assert same.mean() > 0.99
            numeric = (ends[0].residual - ends[1].residual)[:, same] / 2e-6
            exact = np.einsum("cln,l->cn", lin.J_local, T[:, i])[:, same]
            assert np.abs(numeric - exact).max() < 1e-5 * np.abs(exact).max(), name


def test_a_camera_one_percent_too_long_is_put_right() -> None:
    """Oracle: the true focal lengths and the projector's, 0.1 px of noise, a prior of 1 %.

    Fixed, the wrong camera takes the projector's focal length with it by more than twice that.
    """
    rig = with_noise(small_rig("direction_cosine"), 0.1, 0)
    std = [0.01 * rig.camera.K[0, 0], 0.01 * rig.camera.K[1, 1], 1.0, 1.0]
    camera = camera_of(rig, 0.01, K_std=std)
    errors = {}
    for mode in ("fixed", "shared"):
        record = rig_file(rig, camera=camera, share={"camera_focal": mode})
        solution = calibrate([map_of(rig)], record, Options(jackknife=False)).solution
        assert isinstance(solution.projector.focal.value, float)
        errors[mode] = abs(solution.projector.focal.value / 330.0 - 1)
    assert errors["shared"] < 0.5 * errors["fixed"]
    estimate = solution.blocks["camera_focal"]
    true = np.array([rig.camera.K[0, 0], rig.camera.K[1, 1]])
    assert isinstance(estimate.value, list)
    assert isinstance(estimate.std, list)
    assert np.abs(np.array(estimate.value) / true - 1).max() < 4e-3
    assert np.all(np.array(estimate.std) < std[:2])
    assert solution.camera is not None
    assert solution.camera.K[0][0] == pytest.approx(estimate.value[0])
    assert any(line.startswith("Camera focal length: ") for line in solution.verdict)


def test_a_narrow_prior_holds_and_a_wide_one_does_not() -> None:
    """Oracle: with 0.001 % the given value, wrong by 1 %, stays; its deviation is the prior's."""
    rig = with_noise(small_rig("pinhole"), 0.3, 0)
    camera = camera_of(rig, 0.01, K_std=[1e-5 * K for K in (100.0, 100.0)] + [1.0, 1.0])
    record = rig_file(rig, camera=camera, share={"camera_focal": "shared"})
    solution = calibrate([map_of(rig)], record, Options(jackknife=False)).solution
    estimate = solution.blocks["camera_focal"]
    assert isinstance(estimate.value, list)
    assert isinstance(estimate.std, list)
    np.testing.assert_allclose(estimate.value, np.diag(camera["K"])[:2], rtol=1e-4)
    np.testing.assert_allclose(estimate.std, [1e-3, 1e-3], rtol=0.3)


def test_priors_are_on_unknown_blocks_alone() -> None:
    """Oracle: residuals are differences over the deviations of the rig, blocks without are free."""
    rig = small_rig("pinhole")
    record = rig_file(rig, camera=camera_of(rig, **PRIOR), share=ALL)
    problem, state = problem_of([rig], record)
    (term,) = [t for t in problem.terms if isinstance(t, GaussianPriorTerm)]
    assert term.informative
    centre = np.array([0.8, -1.8])
    moved = state.with_value("camera_centre", 0, state.at("camera_centre", 0) + centre)
    r = term.residual(moved)
    np.testing.assert_allclose(r, [0, 0, 1.0, -2.0, 0, 0, 0, 0, 0], atol=1e-12)
    fixed = make_layout(rig_file(rig, camera=camera_of(rig, **PRIOR)), 1)
    assert not fixed.free["camera_focal"]


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"K_std": [1.0, 0.0, 1.0, 1.0]}, "K_std"),
        ({"K_std": [1.0, -1.0, 1.0, 1.0]}, "K_std"),
        ({"K_std": [1.0, 1.0]}, "K_std"),
        ({"distortion_std": 0.0}, "distortion_std"),
        ({"distortion_std": [0.01, 0.01]}, "distortion_std"),
    ],
)
def test_bad_deviations_are_refused(changes: dict[str, Any], where: str) -> None:
    """Oracle: an InputError whose sentence names the field."""
    with pytest.raises(InputError) as caught:
        validate(Camera, camera_of(small_rig("pinhole"), **changes), "rig.yaml")
    assert where in str(caught.value)


def test_a_camera_of_its_own_for_every_frame_is_refused() -> None:
    """Oracle: an InputError that names the field and what can be had."""
    record = rig_file(small_rig("pinhole"), share={"camera_focal": "per_frame"})
    with pytest.raises(InputError) as caught:
        make_layout(record, 2)
    assert caught.value.where == "share.camera_focal"

"""Every value beside the truth: errors that are put in come out, over their deviations."""

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_endo.evaluate.errors import evaluate
from mitsuba_endo.evaluate.values import ComparedValue
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.solution import Estimate, PoseEstimate, Solution
from tests.evaluate.records import CAMERA_POSES, NAMES, record_of, with_focal, with_frame

pytestmark = pytest.mark.usefixtures("llvm")


def _values(solution: Solution, truth: Solution) -> dict[tuple[str, str], ComparedValue]:
    return {(v.group, v.quantity): v for v in evaluate(solution, truth).values}


def _pose(world: SimpleNamespace, step: list[float], std: list[float]) -> PoseEstimate:
    pose = world.pose.perturbed(np.array(step))
    return PoseEstimate.of(pose, std=std, covariance=np.diag(np.square(std)).tolist())


def test_errors_over_deviations(world: SimpleNamespace):
    """Oracle: a step of the solver's chart put in: 3 deviations of one rotation, 1 of a shift."""
    std = [1e-3, 1e-3, 2e-3, 0.1, 0.1, 0.2]
    moved = _pose(world, [3e-3, 0, 0, 0, 0.1, 0], std)
    solution = with_focal(record_of(world), value=122.0, std=4.0, status="measured")
    found = _values(with_frame(solution, 1, projector_from_camera=moved), record_of(world))
    turned = found["b.exr", "projector rotation x"]
    assert turned.error == pytest.approx(np.degrees(3e-3), rel=1e-6)
    assert turned.deviations == pytest.approx(3.0, rel=1e-6)
    assert turned.inside is False
    shifted = found["b.exr", "projector translation y"]
    assert shifted.error == pytest.approx(0.1)
    assert shifted.interval == pytest.approx(1.96 * 0.1)
    assert shifted.inside is True
    focal = found["projector", "focal length"]
    assert (focal.found, focal.true, focal.error) == (122, 120, 2)
    assert focal.deviations == pytest.approx(0.5)
    assert found["a.exr", "projector rotation x"].inside is None  # no deviation, no interval


def test_the_baseline_s_deviation_is_along_the_baseline(world: SimpleNamespace):
    """Oracle: sqrt(u' C u) of a covariance with correlation; the first frame gives the scale."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6)) * 0.01
    covariance = root @ root.T
    std = np.sqrt(np.diag(covariance)).tolist()
    pose = PoseEstimate.of(world.pose, std=std, covariance=covariance.tolist())
    record = record_of(world, scale="baseline")
    record = with_frame(with_frame(record, 0, projector_from_camera=pose), 1,
                        projector_from_camera=pose)  # fmt: skip
    found = _values(record, record_of(world))
    u = world.pose.t / np.linalg.norm(world.pose.t)
    expected = np.sqrt(u @ covariance[3:, 3:] @ u)
    assert found["b.exr", "baseline"].std == pytest.approx(expected)
    assert found["a.exr", "baseline"].interval is None
    assert found["a.exr", "baseline"].status == "fixed"


def test_camera_poses_are_compared_in_the_solution_s_world(world: SimpleNamespace):
    """Oracle: the truth in a world of its own gives the same errors, zero but for the step."""
    other = RigidTransform.of([0.3, -0.1, 0.2], [5.0, 7, -3])
    truth = record_of(world)
    frames = [
        f.model_copy(update={"world_from_camera": PoseEstimate.of(other @ pose)})
        for f, pose in zip(truth.frames, CAMERA_POSES, strict=True)
    ]
    truth = truth.model_copy(update={"frames": frames})
    stepped = CAMERA_POSES[2].perturbed(np.array([0, 0.002, 0, 0, 0, -0.3]))
    known = PoseEstimate.of(stepped, std=[1e-3] * 3 + [0.1] * 3)
    found = _values(with_frame(record_of(world), 2, world_from_camera=known), truth)
    assert found["c.exr", "camera rotation y"].deviations == pytest.approx(2.0, rel=1e-6)
    assert found["c.exr", "camera translation z"].error == pytest.approx(-0.3)
    assert found["b.exr", "camera translation x"].error == pytest.approx(0, abs=1e-9)
    assert ("a.exr", "camera translation x") not in found


def test_camera_poses_that_were_given_are_no_errors(world: SimpleNamespace):
    """Oracle: frames with surfaces of their own: their cameras stay, whatever truly moved."""
    still = PoseEstimate.of(RigidTransform.identity(), status="fixed")
    solution = record_of(world, outcome="converged", scale="baseline")
    solution = solution.model_copy(
        update={
            "frames": [f.model_copy(update={"world_from_camera": still}) for f in solution.frames]
        }
    )
    metrics = evaluate(solution, record_of(world))
    assert metrics.frames[1].camera_translation_error_mm is None
    assert not [v for v in metrics.values if v.quantity.startswith("camera translation")]


def test_up_to_scale_is_compared_in_baselines(world: SimpleNamespace):
    """Oracle: all lengths of a solution divided by its baseline: no error is left."""
    length = float(np.linalg.norm(world.pose.t))
    solution = record_of(world, units="baseline", scale="up_to_scale")
    unit = PoseEstimate.of(RigidTransform(world.pose.R, world.pose.t / length))
    for k, pose in enumerate(CAMERA_POSES):
        placed = PoseEstimate.of(RigidTransform(pose.R, pose.t / length))
        solution = with_frame(solution, k, projector_from_camera=unit, world_from_camera=placed)
    values = evaluate(solution, record_of(world)).values
    lengths = [v for v in values if v.unit == "baselines"]
    assert len(lengths) == len(NAMES) * 4 + 2 * 3
    assert max(abs(v.error or 0) for v in lengths) < 1e-9


def test_what_was_not_determined_keeps_its_reason(world: SimpleNamespace):
    """Oracle: null error, the reason; missing coefficients count as zero."""
    solution = with_focal(record_of(world), value=None, status="unobservable", reason="a plane")
    lens = solution.projector.model_copy(
        update={"distortion": Estimate(value=[0.05, 0.2], std=[0.01, 0.1], status="measured")}
    )
    found = _values(solution.model_copy(update={"projector": lens}), record_of(world))
    focal = found["projector", "focal length"]
    assert (focal.error, focal.inside, focal.reason) == (None, None, "a plane")
    assert found["projector", "distortion 1"].deviations == pytest.approx(2.0)
    assert found["projector", "distortion 2"].error == pytest.approx(0.2)

"""All frames together: derivatives, elimination, loops, intervals, wrong models.

Scenes are those of the sequences; frames begin at poses that are off, so that nothing is tracked.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.sequence.adjustment.adjust import Adjusted, adjust
from mitsuba_endo.sequence.adjustment.between import place_between
from mitsuba_endo.sequence.adjustment.drift_and_gauge import Plan, drift_equations
from mitsuba_endo.sequence.adjustment.equations import Weights, columns_of, equations
from mitsuba_endo.sequence.adjustment.observations import (
    AdjustedFrame,
    Elements,
    Seen,
    observe,
)
from mitsuba_endo.sequence.linearise import Poses
from mitsuba_endo.sequence.projector_prior import ProjectorDrift
from mitsuba_endo.sequence.view import view_of
from tests.sequences import Recording, exact, pan

Floats = NDArray[np.float64]
FREE = ProjectorDrift(np.full(6, np.inf), held=False)


def _white(q: Floats, _size: tuple[int, int], rng: np.random.Generator) -> Floats:
    return q + rng.normal(0, 0.3, q.shape)


@pytest.fixture(scope="module")
def loop() -> Recording:
    return pan(13, noise=_white)


def _true_poses(recording: Recording, k: int) -> Poses:
    return Poses(recording.world_from_camera[k], recording.projector_from_camera[k])


def _frame(recording: Recording, k: int, poses: Poses | None = None) -> AdjustedFrame:
    view = view_of(recording.map(k), recording.camera, 1)
    return AdjustedFrame(k, view, poses or _true_poses(recording, k), 0.3)


def _elements(recording: Recording, frames: list[int], every: int = 7) -> Elements:
    """Points that some frames saw, with the normals of their neighbours."""
    points, normals = [], []
    for k in frames:
        q, at = recording.exact(k)
        normal = np.cross(np.gradient(at, axis=0), np.gradient(at, axis=1))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        normal *= -np.sign((normal * at).sum(-1, keepdims=True))
        good = np.isfinite(q).all(-1) & np.isfinite(normal).all(-1)
        pose = recording.world_from_camera[k]
        points.append(pose.apply(at[good][::every]))
        normals.append(pose.rotate(normal[good][::every]))
    return Elements(np.concatenate(points), np.concatenate(normals))


def _opened(recording: Recording) -> list[AdjustedFrame]:
    """Frames that drift: the last one by 0.8 mm and 0.6 degrees, where it is the first again."""
    frames, last = [], len(recording) - 1
    for k in range(len(recording)):
        true, part = _true_poses(recording, k), k / last
        off = RigidTransform.of(0.01 * part * np.array([0.3, 1, -0.2]), [0.5 * part, 0, 0.6 * part])
        step = part * np.array([0.002, -0.001, 0.001, 0.01, 0.02, -0.02])
        frames.append(
            _frame(recording, k, Poses(off @ true.world_from_camera,
                                       true.projector_from_camera.perturbed(step)))
        )  # fmt: skip
    return frames


@pytest.fixture(scope="module")
def closed(loop: Recording) -> Adjusted:
    elements = _elements(loop, [0, 4, 8])
    return adjust(_opened(loop), elements, loop.projector.with_(focal=301.0), Plan(FREE))


def _gap(frames: list[AdjustedFrame], recording: Recording) -> float:
    """How far the last camera is from where it should be, seen from the first, mm."""
    found = frames[0].poses.world_from_camera.inverse() @ frames[-1].poses.world_from_camera
    true = recording.world_from_camera[0].inverse() @ recording.world_from_camera[-1]
    return float(np.linalg.norm(found.t - true.t))


def test_derivatives_of_what_is_predicted() -> None:
    """Oracle: differences. Elements are what the frame saw, so that residuals are zero."""
    scene = pan(3, noise=exact)
    elements, frame = _elements(scene, [1]), _frame(scene, 1)
    seen = observe(frame, elements, scene.projector, 1.0)
    assert np.abs(seen.along * seen.noise).max() < 1e-3
    h = 1e-5
    for j in range(13):
        step = h * np.eye(13)[j]
        moved = replace(frame, poses=frame.poses.moved(step[:12]))
        projector = scene.projector.with_(focal=float(scene.projector.focal) * np.exp(step[12]))
        after = observe(moved, elements, projector, 1.0)
        _, a, b = np.intersect1d(seen.element, after.element, return_indices=True)
        assert len(a) > 0.9 * len(seen.element)
        for name, J in (("along", seen.by_unknowns), ("across", seen.across_by_unknowns)):
            one, other = (getattr(s, name) * s.noise for s in (seen, after))
            found = -(other[b] - one[a]) / h
            wanted = (J[j] * seen.noise)[a]
            size = np.abs(seen.by_unknowns[j] * seen.noise).max()
            assert np.median(np.abs(found - wanted)) < 1e-3 * size
    raised = observe(frame, elements.moved(np.full(len(elements.points), h)), scene.projector, 1.0)
    _, a, b = np.intersect1d(seen.element, raised.element, return_indices=True)
    change = -(raised.along[b] * raised.noise - seen.along[a] * seen.noise) / h
    wanted = (seen.by_element * seen.noise)[a]
    assert np.median(np.abs(change - wanted)) < 1e-3 * np.abs(wanted).max()


def _random_seen(rng: np.random.Generator, elements: int) -> Seen:
    element = np.sort(rng.choice(elements, 300, replace=False))
    n = len(element)
    return Seen(
        element, rng.integers(0, 54, n), rng.normal(size=n), rng.normal(size=(13, n)),
        rng.uniform(1, 2, n), rng.normal(size=n), rng.normal(size=(13, n)),
        rng.uniform(0.5, 1, n), rng.uniform(0.2, 0.5, n), 0.3,
    )  # fmt: skip


def test_elimination_is_that_of_all_unknowns() -> None:
    """Oracle: dense least squares with one column for each element; two chunks."""
    rng, count = np.random.default_rng(0), 450
    seen = [_random_seen(rng, count) for _ in range(3)]
    at = equations(seen, [Weights(s.on_line, s.weight) for s in seen], count)
    views = np.bincount(np.concatenate([s.element for s in seen]), minlength=count)
    rows, values = [], []
    for k, s in enumerate(seen):
        shared = views[s.element] >= 2
        J = np.zeros((len(s.element), 37 + count))
        J[:, columns_of(k, 37)] = s.by_unknowns.T
        J[np.arange(len(J)), 37 + s.element] = s.by_element
        root = np.sqrt(np.where(shared, s.weight, 0.0))
        rows.append(J * root[:, None])
        values.append(s.along * root)
        J = np.zeros((len(s.element), 37 + count))
        J[:, columns_of(k, 37)] = s.across_by_unknowns.T
        rows.append(J * np.sqrt(s.on_line)[:, None])
        values.append(s.across * np.sqrt(s.on_line))
    x = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    step = np.linalg.solve(at.A, at.b).astype(np.float64)
    assert step == pytest.approx(x[:37], abs=1e-5)  # responses are kept in single precision
    assert at.element_steps(step) == pytest.approx(x[37:], abs=1e-5)


def test_derivatives_of_the_drift(loop: Recording) -> None:
    """Oracle: A x = b brings three poses to where the second and third are the first."""
    frames = [_frame(loop, 0), _frame(loop, 1), _frame(loop, 2)]
    drift = ProjectorDrift(np.full(6, 0.1), held=False)
    for _ in range(3):
        A, b = drift_equations(frames, drift)
        A[:6, :6] += 1e9 * np.eye(6)
        step = np.linalg.lstsq(A, b, rcond=None)[0].astype(np.float64)
        frames = [
            replace(f, poses=f.poses.moved(step[12 * k : 12 * k + 12]))
            for k, f in enumerate(frames)
        ]
    first, _, last = (f.poses.projector_from_camera for f in frames)
    assert last.matrix() == pytest.approx(first.matrix(), abs=1e-6)


def test_a_loop_closes(loop: Recording, closed: Adjusted) -> None:
    """Oracle: the scene; 0.1 mm is a quarter of a pixel on the wall."""
    assert _gap(_opened(loop), loop) > 0.7
    assert _gap(closed.frames, loop) < 0.1
    assert closed.frames[0].poses.world_from_camera.matrix() == pytest.approx(np.eye(4))
    baseline = np.linalg.norm(closed.frames[0].poses.projector_from_camera.t)
    assert baseline == pytest.approx(np.linalg.norm(loop.projector_from_camera[0].t), rel=1e-9)


def test_the_focal_length_comes_with_its_deviation(loop: Recording, closed: Adjusted) -> None:
    """Oracle: the scene; it began 0.3 % off."""
    true = float(loop.projector.focal)
    off, std = float(closed.projector.focal) / true - 1, closed.covariance.focal_std
    assert abs(off) < 3 * std < 0.001


def test_errors_are_as_large_as_stated(loop: Recording, closed: Adjusted) -> None:
    """Oracle: the scene; white noise, and means over frames whose errors go together."""
    errors = []
    for k, frame in enumerate(closed.frames[1:], 1):
        std = np.sqrt(np.diag(closed.covariance.of_frame(k)))[9:]
        pose, true = frame.poses.world_from_camera, loop.world_from_camera[k]
        errors.append(pose.R.T @ (pose.t - true.t) / std)
    assert 0.4 < np.sqrt(np.mean(np.square(errors))) < 2.0


def test_a_frame_between_goes_where_it_was(loop: Recording, closed: Adjusted) -> None:
    """Oracle: the scene. The frame was tracked on the open loop, with the drift of its neighbour;
    its deviations count those of the adjusted frames."""
    opened = _opened(loop)
    kept = [f for f in opened if f.number != 6]
    adjusted = adjust(kept, _elements(loop, [0, 4, 8]), loop.projector, Plan(FREE))
    (placed,) = place_between(adjusted, kept, [opened[6]], FREE)
    true = loop.world_from_camera[6]
    before = np.linalg.norm(opened[6].poses.world_from_camera.t - true.t)
    after = np.linalg.norm(placed.poses.world_from_camera.t - true.t)
    assert after < 0.15 < before
    near = np.sqrt(np.diag(closed.covariance.of_frame(6)))
    ratio = np.sqrt(np.diag(placed.covariance)) / near
    assert (ratio > 0.6).all()
    assert (ratio < 2.5).all()


def test_a_held_wrong_focal_length_shows_in_the_misfit(loop: Recording, closed: Adjusted) -> None:
    """With a focal length 1 % off, and held, no pose makes frames agree as well."""
    wrong = loop.projector.with_(focal=1.01 * float(loop.projector.focal))
    plan = Plan(FREE, focal_free=False)
    found = adjust(_opened(loop), _elements(loop, [0, 4, 8]), wrong, plan)
    noise, usual = (np.mean([f.noise for f in a.frames]) for a in (found, closed))
    assert noise > 1.02 * usual


def test_a_frame_that_shows_another_place_is_not_pulled_in(loop: Recording) -> None:
    """A patch that moved by itself, as tissue does, is left out by the loss."""
    frames = [_frame(loop, k) for k in range(6)]
    q = loop.map(3).q.copy()
    q[40:70, 50:90, 0] += 9.0
    moved = view_of(CorrespondenceMap(q, "moved"), loop.camera, 1)
    frames[3] = replace(frames[3], view=moved)
    found = adjust(frames, _elements(loop, [0, 4]), loop.projector, Plan(FREE)).frames[3]
    off = found.poses.world_from_camera.t - loop.world_from_camera[3].t
    assert np.linalg.norm(off) < 0.3

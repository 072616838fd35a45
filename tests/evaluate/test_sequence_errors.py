"""Errors of a sequence: none for the truth itself, and those put in where they were put in."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.sequence_errors import evaluate_sequence
from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from mitsuba_endo.evaluate.tracked_frames import PosePairs, TrackedFrames
from mitsuba_endo.evaluate.trajectory_errors import trajectory_alignment
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.records.trajectory import FrameRow
from tests.sequences import Recording, exact, withdrawal

COUNT = 24
STD = np.array([0.001, 0.001, 0.001, 0.1, 0.1, 0.1])


@pytest.fixture(scope="module")
def clean() -> Recording:
    return withdrawal(COUNT, noise=exact)


@pytest.fixture(scope="module")
def truth(clean: Recording) -> Solution:
    return clean.truth


def _rows(clean: Recording) -> list[FrameRow]:
    return [
        FrameRow(k, f"frame{k:04d}.exr", world_from_camera=clean.world_from_camera[k],
                 projector_from_camera=clean.projector_from_camera[k], camera_std=STD,
                 projector_std=STD)
        for k in range(COUNT)
    ]  # fmt: skip


def _compare(clean: Recording, truth: Solution, rows: list[FrameRow], **of: object):
    mesh = clean.surface
    surface = of.pop("surface", mesh)
    solution = truth.model_copy(update=of)
    return evaluate_sequence(TrackedFrames(solution, rows, surface), truth, mesh)  # type: ignore[arg-type]


def test_the_truth_has_no_errors(clean: Recording, truth: Solution) -> None:
    """Two frames are lost; the first of them begins another world."""
    rows = _rows(clean)
    rows[0] = FrameRow(0, "frame0000.exr", lost="blood")
    rows[9] = FrameRow(9, "frame0009.exr", lost="blood")
    first = clean.world_from_camera[1].inverse()
    moved = [
        row if row.world_from_camera is None
        else replace(row, world_from_camera=first @ row.world_from_camera)
        for row in rows
    ]  # fmt: skip
    mesh = SurfaceEstimate(first.apply(clean.mesh.vertices.astype(float)), clean.mesh.faces)
    found = _compare(clean, truth, moved, surface=mesh)
    assert (found.frames, found.lost, found.other_parts) == (COUNT, 2, 0)
    zero = [
        found.ate_aligned_rms_mm, found.ate_first_rms_mm, found.rpe_shift_rms_mm,
        found.last_to_first_mm, found.scale_error_percent, found.scale_worst_percent,
        found.focal_error_percent, found.surface_rms_mm,
    ]  # fmt: skip
    assert zero == pytest.approx([0] * 8, abs=1e-6)
    assert found.completeness_percent == 100
    assert found.camera_intervals_percent == found.projector_intervals_percent == 100
    assert len(found.depth) >= 10
    assert max(d.median_mm for d in found.depth if d.median_mm is not None) < 1e-3
    assert min(d.covered_percent for d in found.depth) > 99


def test_errors_put_in_are_found(clean: Recording, truth: Solution) -> None:
    """Oracle: a way 2 % too long, one frame 3 mm off, half of the surface, a focal length."""
    rows = [
        replace(row, world_from_camera=RigidTransform(
            row.world_from_camera.R, 1.02 * row.world_from_camera.t))
        for row in _rows(clean) if row.world_from_camera is not None
    ]  # fmt: skip
    found = _compare(clean, truth, rows)
    assert found.scale_error_percent == pytest.approx(2, abs=1e-3)
    end = np.linalg.norm(clean.world_from_camera[-1].t)
    assert found.last_to_first_mm == pytest.approx(0.02 * end, rel=1e-3)
    far = np.abs(0.02 * np.array([pose.t for pose in clean.world_from_camera])) > 1.96 * 0.1
    assert far.any()
    assert found.camera_intervals_percent == pytest.approx(100 - 50 * far.mean())
    assert found.projector_intervals_percent == 100
    off = _rows(clean)
    pose = off[5].world_from_camera
    assert pose is not None
    off[5] = replace(
        off[5], world_from_camera=RigidTransform(pose.R, pose.t + np.array([0, 3.0, 0]))
    )
    wrong = _compare(clean, truth, off)
    assert wrong.ate_aligned_max_mm == pytest.approx(3, abs=0.3)
    assert wrong.ate_first_rms_mm == pytest.approx(3 / np.sqrt(COUNT), abs=1e-6)
    half = clean.mesh.faces[clean.mesh.vertices[clean.mesh.faces[:, 0], 0] > 0]
    part = _compare(
        clean, truth, _rows(clean),
        surface=SurfaceEstimate(clean.mesh.vertices.astype(float), half),
    )  # fmt: skip
    assert part.completeness_percent is not None
    assert 20 < part.completeness_percent < 80
    assert np.mean([d.covered_percent for d in part.depth]) < 80


def test_scale_is_taken_out_where_it_is_not_known(clean: Recording, truth: Solution) -> None:
    """Oracle: everything in units of five millimetres."""
    rows = [
        replace(row, world_from_camera=RigidTransform(
            row.world_from_camera.R, row.world_from_camera.t / 5))
        for row in _rows(clean) if row.world_from_camera is not None
    ]  # fmt: skip
    mesh = SurfaceEstimate(clean.mesh.vertices.astype(float) / 5, clean.mesh.faces)
    found: SequenceMetrics = _compare(clean, truth, rows, units="baseline", surface=mesh)
    assert found.ate_aligned_rms_mm == pytest.approx(0, abs=1e-6)
    assert found.surface_rms_mm == pytest.approx(0, abs=1e-6)
    assert found.last_to_first_mm == pytest.approx(0, abs=1e-6)
    assert found.ate_first_rms_mm is None
    assert found.scale_error_percent is None
    assert found.scale_worst_percent is None
    assert found.camera_intervals_percent is None


def test_a_straight_way_leaves_no_rotation_of_the_surface_open(
    clean: Recording, truth: Solution
) -> None:
    """Cameras exactly on a line, and a surface that is right: were it aligned by their centres
    alone, any rotation about the line would do."""

    def on_line(k: int) -> RigidTransform:
        return RigidTransform(np.eye(3), np.array([1e-6 * k**2, 0, -0.5 * k]))

    frames = [
        frame.model_copy(update={"world_from_camera": frame.world_from_camera.model_copy(
            update={"R": np.eye(3).tolist(), "t": on_line(k).t.tolist()})})
        for k, frame in enumerate(truth.frames)
    ]  # fmt: skip
    rng = np.random.default_rng(0)
    rows = [
        replace(row, world_from_camera=on_line(row.number).perturbed(
            np.concatenate([np.zeros(3), rng.normal(0, 0.02, 3)])))
        for row in _rows(clean)
    ]  # fmt: skip
    found = _compare(clean, truth.model_copy(update={"frames": frames}), rows)
    assert found.surface_rms_mm is not None
    assert found.surface_rms_mm < 0.05


def test_the_larger_part_is_compared(clean: Recording, truth: Solution) -> None:
    rows = [replace(row, part=int(row.number >= 18)) for row in _rows(clean)]
    assert _compare(clean, truth, rows).other_parts == 6


def test_another_truth_is_refused(clean: Recording, truth: Solution) -> None:
    rows = [replace(row, name=f"other{row.number}") for row in _rows(clean)]
    with pytest.raises(InputError, match="has no poses of the frame other0"):
        _compare(clean, truth, rows)
    with pytest.raises(InputError, match="2 frames with a pose"):
        _compare(clean, truth, _rows(clean)[:2])


def test_the_worst_part_of_the_way_is_found(clean: Recording) -> None:
    """Oracle: of 150 frames the last 30 are 2 % too far apart, so that the last of the windows is
    worst, and worse than the whole way."""
    count = 150
    long = withdrawal(count, noise=exact)
    true = [pose.t for pose in long.world_from_camera]
    rows = []
    for k in range(count):
        beyond = max(k - 120, 0)
        t = true[k] + 0.02 * (true[k] - true[k - beyond])
        at = RigidTransform(long.world_from_camera[k].R, t)
        rows.append(FrameRow(k, f"frame{k:04d}", world_from_camera=at,
                             projector_from_camera=long.projector_from_camera[k]))  # fmt: skip
    pairs = PosePairs(rows, list(zip(long.world_from_camera, long.projector_from_camera,
                                     strict=True)))  # fmt: skip
    by = trajectory_alignment(pairs.found[50:], pairs.true[50:], "similarity")
    scales = pairs.scale_errors()
    assert scales["scale_worst_percent"] == pytest.approx(100 / by.scale - 100)
    assert scales["scale_worst_percent"] > 1.2 * scales["scale_error_percent"] > 0


def test_intervals_of_vertices(clean: Recording, truth: Solution) -> None:
    """Oracle: a surface 0.5 mm too far along z, for half of whose vertices twice that is stated."""
    off = 0.5
    shifted = clean.surface.vertices + np.array([0, 0, off])
    std = np.where(np.arange(len(shifted)) % 2, 2 * off, 1e-6)
    surface = SurfaceEstimate(shifted, clean.mesh.faces, std)
    found = _compare(clean, truth, _rows(clean), surface=surface)
    assert found.vertex_intervals_percent == pytest.approx(50, abs=2)
    without = _compare(clean, truth, _rows(clean))
    assert without.vertex_intervals_percent is None

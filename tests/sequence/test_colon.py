"""A withdrawal through a folded colon, maps of 160 x 120 pixels with errors as of the decoder."""

import numpy as np

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.evaluate.trajectory_errors import absolute_trajectory_error, trajectory_alignment
from mitsuba_endo.sequence.outcome import SequenceResult
from mitsuba_endo.sequence.run import Recorded
from tests.lumen import FOCAL
from tests.sequence.conftest import COUNT, NOTHING
from tests.sequences import Recording


def test_frames_of_nothing_alone_are_lost_and_named(result: SequenceResult) -> None:
    assert [row.number for row in result.rows] == list(range(COUNT))
    assert [(row.number, row.lost) for row in result.lost] == [(k, "blood") for k in NOTHING]
    assert "frame0022: blood" in result.solution.verdict[0]
    assert len(result.surfaces) == 1


def test_cameras_are_where_they_were(result: SequenceResult, colon: Recording) -> None:
    """Oracle: the scene. 0.3 mm is 1 % of the distance of the wall."""
    rows = result.of_part(0)
    found = [row.world_from_camera for row in rows if row.world_from_camera is not None]
    true = [colon.world_from_camera[row.number] for row in rows]
    first, aligned = (
        absolute_trajectory_error(found, true, trajectory_alignment(found, true, how))
        for how in ("none", "rigid")
    )
    assert np.sqrt(np.mean(first**2)) < 0.3
    assert np.sqrt(np.mean(aligned**2)) < 0.15


def test_focal_length_and_baselines(result: SequenceResult, colon: Recording) -> None:
    """Oracle: the scene. The focal length lies in its interval, and this is narrow."""
    focal = result.solution.projector.focal
    assert isinstance(focal.value, float)
    assert isinstance(focal.std, float)
    assert abs(focal.value - FOCAL) < 3 * focal.std < 0.003 * FOCAL
    for row in result.of_part(0):
        assert row.projector_from_camera is not None
        true = np.linalg.norm(colon.projector_from_camera[row.number].t)
        assert abs(np.linalg.norm(row.projector_from_camera.t) / true - 1) < 0.01


def test_surface_is_the_colons(result: SequenceResult, colon: Recording) -> None:
    """Oracle: the scene's mesh. One pixel's noise is 0.2 mm at the distance of the wall."""
    (surface,) = result.surfaces
    assert surface is not None
    error = distance_to_mesh(surface.vertices, colon.mesh.vertices, colon.mesh.faces)
    assert np.sqrt(np.mean(error**2)) < 0.25
    q, points = colon.exact(15)
    seen = colon.world_from_camera[15].apply(points[np.isfinite(q).all(-1)])[::50]
    near = distance_to_mesh(seen, surface.vertices, surface.faces) < 1
    assert near.mean() > 0.9


def test_vertices_err_by_their_deviations(result: SequenceResult, colon: Recording) -> None:
    """Oracle: the scene, first cameras put together; 95 % intervals hold the truth in 80 to 100 %,
    and stating twice the deviation would be too much."""
    (surface,) = result.surfaces
    assert surface is not None
    error = distance_to_mesh(surface.vertices, colon.mesh.vertices, colon.mesh.faces)
    known = np.isfinite(surface.std)
    assert known.mean() > 0.95
    off = error[known] / surface.std[known]
    assert (off < 1.96).mean() > 0.8
    assert (off < 1.0).mean() < 0.9


def test_deviations_are_those_of_the_errors(result: SequenceResult, colon: Recording) -> None:
    """Errors of projector poses are some one to two deviations; of every one by white noise."""
    errors = []
    for row in result.of_part(0)[1:]:
        assert row.projector_from_camera is not None
        assert row.projector_std is not None
        assert row.camera_std is not None
        assert (row.camera_std > 0).all()
        off = row.projector_from_camera.t - colon.projector_from_camera[row.number].t
        errors.append(off / row.projector_std[3:])
    assert 0.4 < np.sqrt(np.mean(np.square(errors))) < 2.5


def test_keyframes_fit_the_surface(result: SequenceResult) -> None:
    """Noise of a coordinate is 0.35 px; rendered and observed differ by hardly more."""
    assert result.keyframes is not None
    frames = result.solution.frames
    assert len(frames) == len(result.keyframes.frames) >= 2
    assert frames[0].world_from_camera.t == [0, 0, 0]
    for frame in frames:
        assert frame.rms_px is not None
        assert frame.rms_px < 0.7


def test_memory_is_that_of_the_map(recorded: Recorded) -> None:
    """What is kept of a frame is its row; maps of a few keyframes alone stay."""
    assert len(recorded.kept[0].kept) == len([r for r in recorded.rows if r.keyframe])
    assert recorded.parts[0].volume.bytes < 20e6

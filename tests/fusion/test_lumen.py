"""A closed, folded colon seen by six cameras that are withdrawn."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.fusion import FusedMesh, RangeFrame, fuse, voxel_size
from tests.fusion.views import check_clean, noisy
from tests.lumen import FOCAL, Lumen, withdrawn

PATTERN_NOISE = 0.3 / (FOCAL * 5.5)
"""Of the range, per squared range: 0.3 pattern pixels over a baseline of 5.5 mm; 0.16 mm at 30."""


@pytest.fixture(scope="module")
def lumen() -> Lumen:
    return withdrawn(noise=0.0)


@pytest.fixture(scope="module")
def frames(lumen: Lumen) -> list[RangeFrame]:
    return [
        RangeFrame(r, lumen.camera, pose)
        for r, pose in zip(lumen.ranges, lumen.world_from_camera, strict=True)
    ]


@pytest.fixture(scope="module")
def exact(frames: list[RangeFrame]) -> FusedMesh:
    return fuse(frames)


@pytest.fixture(scope="module")
def rough(frames: list[RangeFrame]) -> FusedMesh:
    rng = np.random.default_rng(7)
    return fuse([noisy(frame, PATTERN_NOISE, rng) for frame in frames])


def errors(lumen: Lumen, mesh: FusedMesh) -> np.ndarray:
    """Return the distances of 5,000 vertices to the true surface, mm."""
    some = mesh.vertices[:: max(1, len(mesh.vertices) // 5000)]
    return distance_to_mesh(some, lumen.mesh.vertices, lumen.mesh.faces)


def test_exact_ranges_give_the_surface(lumen: Lumen, exact: FusedMesh) -> None:
    """To a twentieth of a voxel; at the folds' contours to one."""
    check_clean(exact)
    error = errors(lumen, exact)
    voxel = 0.43
    assert np.sqrt(np.mean(error**2)) < 0.05 * voxel
    assert error.max() < voxel


def test_what_any_frame_saw_is_there(lumen: Lumen, exact: FusedMesh) -> None:
    """Also where the first frame saw nothing. The rest is a border of a pixel and steep walls."""
    for of in (lumen.seen.any(0), lumen.hidden_from_first):
        assert lumen.completeness(exact.vertices, exact.faces, of, within=0.5) > 0.9
        assert lumen.completeness(exact.vertices, exact.faces, of, within=1.0) > 0.95


def test_nothing_is_there_that_no_frame_saw(lumen: Lumen, exact: FusedMesh) -> None:
    """The feet of folds that no camera looks behind stay open, as does the tube's near end."""
    middles = exact.vertices[exact.faces[::7]].mean(1)
    assert distance_to_mesh(middles, lumen.mesh.vertices, lumen.mesh.faces).max() < 0.5
    nearest = min(pose.t[2] for pose in lumen.world_from_camera)
    assert exact.vertices[:, 2].min() > nearest + 5


def test_noisy_ranges_give_the_surface_too(lumen: Lumen, rough: FusedMesh) -> None:
    """Ranges whose noise is 0.2 mm and more average out to less than 0.1 mm."""
    check_clean(rough)
    rms = np.sqrt(np.mean(errors(lumen, rough) ** 2))
    assert rms < 0.1
    assert 1 / 1.6 < np.sqrt(np.mean(rough.std**2)) / rms < 1.6
    assert lumen.completeness(rough.vertices, rough.faces, lumen.seen.any(0), 0.5) > 0.9


def test_faces_look_at_a_camera(lumen: Lumen, rough: FusedMesh) -> None:
    middles = rough.vertices[rough.faces].mean(1)
    a, b, c = (rough.vertices[rough.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    towards = [np.sum((p.t - middles) * normals, axis=1) for p in lumen.world_from_camera]
    assert np.mean(np.max(towards, axis=0) > 0) > 0.999


def test_a_mesh_for_the_solver(lumen: Lumen, frames: list[RangeFrame]) -> None:
    """Ten thousand vertices lose little: the surface is smooth."""
    rng = np.random.default_rng(7)
    mesh = fuse([noisy(frame, PATTERN_NOISE, rng) for frame in frames], vertices=10_000)
    check_clean(mesh)
    assert len(mesh.vertices) == pytest.approx(10_000, rel=0.03)
    assert np.sqrt(np.mean(errors(lumen, mesh) ** 2)) < 0.12
    assert lumen.completeness(mesh.vertices, mesh.faces, lumen.seen.any(0), 0.5) > 0.9


def test_poses_that_are_wrong_show_in_std(frames: list[RangeFrame]) -> None:
    """A frame that is half a millimetre off makes frames disagree."""
    pose = frames[3].world_from_camera
    moved = replace(frames[3], world_from_camera=pose.perturbed(np.array([0, 0, 0, 0.5, 0, 0])))
    wrong = fuse([*frames[:3], moved, *frames[4:]], voxel=voxel_size(frames))
    assert np.median(wrong.std) > 3 * np.median(fuse(frames).std)

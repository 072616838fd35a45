"""Fused planes and spheres against their formulas."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from mitsuba_endo.fusion import RangeFrame, Volume, fuse, surface_of, voxel_size
from mitsuba_endo.geometry.transforms import RigidTransform
from tests.fusion.views import check_clean, face_normals, hollow, look, noisy, plane
from tests.rigs import lopsided_camera, lopsided_fisheye

CENTRE, RADIUS = (3.0, -4.0, 6.0), 25.0
SLANT = plane((0.0, -np.sin(1.15), np.cos(1.15)), 14.0)
"""Met at 66 degrees by a camera that looks along z, at 34 mm."""


def inside_a_sphere(count: int = 5, width: int = 81) -> list[RangeFrame]:
    camera, rng = lopsided_fisheye(width, width * 7 // 9), np.random.default_rng(3)
    turns = [[0, 0, 0], [0.3, 1.4, 0.1], [-0.2, -1.5, 0.4], [1.4, 0.3, 0], [0.2, 3.0, 0.5]]
    poses = [RigidTransform.of(turn, rng.normal(0, 4, 3)) for turn in turns[:count]]
    return [look(hollow(CENTRE, RADIUS), camera, pose) for pose in poses]


def from_centre(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points - np.array(CENTRE), axis=1) - RADIUS


def test_a_plane_seen_at_a_slant_stays_a_plane() -> None:
    """Inverse range is linear over a plane, and distances go by its normal: no slant spoils it.

    Between pixels a lens' ray leaves the chord by less than half the squared angle between them.
    """
    camera = lopsided_camera(60, 44)
    poses = [RigidTransform.identity(), RigidTransform.of([0.2, -0.1, 0.6], [4, 3, -2])]
    frames = [look(SLANT, camera, pose) for pose in poses]
    mesh = fuse(frames)
    check_clean(mesh)
    off = mesh.vertices @ np.array([0.0, -np.sin(1.15), np.cos(1.15)]) - 14
    assert np.abs(off).max() < max(np.max(f.range * f.spacing**2) / 2 for f in frames)
    assert np.all(mesh.normals @ np.array([0.0, -np.sin(1.15), np.cos(1.15)]) < -0.999)


def test_a_sphere_from_inside_closes() -> None:
    """Cameras that together look all around; a chord of a voxel is off by h^2 / 8 R."""
    frames = inside_a_sphere()
    mesh, h = fuse(frames), voxel_size(frames)
    check_clean(mesh)
    assert np.abs(from_centre(mesh.vertices)).max() < h**2 / RADIUS
    normals, middles = face_normals(mesh)
    inwards = np.array(CENTRE) - middles
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    assert np.sum(normals * inwards, axis=1).min() > 0.9
    seen = np.concatenate(
        [f.world_from_camera.apply(f.range[..., None] * f.camera.grid_rays) for f in frames]
    ).reshape(-1, 3)
    assert np.quantile(KDTree(mesh.vertices).query(seen)[0], 0.99) < h


def test_nothing_is_made_of_what_no_pixel_shows() -> None:
    """A fisheye's model also projects what lies behind it; one view is all that one view gives."""
    (frame,) = inside_a_sphere(1)
    at = frame.world_from_camera.inverse().apply(fuse([frame]).vertices)
    uv = frame.camera.project(at)
    assert ((uv > -0.5) & (uv < [frame.camera.width, frame.camera.height])).all()
    assert np.arccos(at[:, 2] / np.linalg.norm(at, axis=1)).max() < np.radians(115)


@pytest.mark.parametrize("height", [4.0, -4.0])
def test_a_step_is_not_bridged(height: float) -> None:
    """Two planes that meet in a step, seen over it and from its side: no face lies between."""
    camera = lopsided_camera(120, 88)
    near, far = plane((0.0, 0.0, 1.0), 40.0), plane((0.0, 0.0, 1.0), 40.0 + abs(height))
    sign = np.sign(height)

    def step(origin: np.ndarray, ways: np.ndarray) -> np.ndarray:
        s = near(origin, ways)
        meets = sign * (origin[0] + s * ways[..., 0] - 1.7 - 0.2 * ways[..., 1]) < 0
        return np.where(meets, s, far(origin, ways))

    poses = [RigidTransform.of([0, 0.05 * k, 0.3 * k], [-3.0 * k, k, 0]) for k in range(3)]
    frames = [look(step, camera, pose) for pose in poses]
    mesh = fuse(frames)
    check_clean(mesh)
    off = np.minimum(abs(mesh.vertices[:, 2] - 40), abs(mesh.vertices[:, 2] - 40 - abs(height)))
    assert off.max() < 0.1 * voxel_size(frames)
    z = mesh.vertices[mesh.faces, 2]
    assert np.ptp(z, axis=1).max() < 0.2 * voxel_size(frames)
    for level in (40, 40 + abs(height)):
        assert (np.abs(mesh.vertices[:, 2] - level) < 1).sum() > 500


def test_noise_averages_out_and_std_says_how_much_is_left() -> None:
    """White noise of 0.1 mm at 25 mm; std is a guess, good to a factor of 1.6."""
    rng = np.random.default_rng(5)
    camera = lopsided_fisheye(108, 84)
    poses = [RigidTransform.of(rng.normal(0, 0.2, 3), rng.normal(0, 2, 3)) for _ in range(8)]
    clear = [look(hollow(CENTRE, RADIUS), camera, pose) for pose in poses]
    frames = [noisy(frame, 0.1 / 25**2, rng) for frame in clear]
    one, all_ = fuse(frames[:1], voxel=0.6), fuse(frames, voxel=0.6)
    error = from_centre(all_.vertices)
    rms = np.sqrt(np.mean(error**2))
    assert rms < 0.55 * np.sqrt(np.mean(from_centre(one.vertices) ** 2))
    assert 1 / 1.6 < np.sqrt(np.mean(all_.std**2)) / rms < 1.6
    assert abs(np.mean(error)) < 0.2 * rms
    assert np.isnan(one.std).all()


def test_weights_pull_the_surface() -> None:
    """Two views of planes 0.8 voxels apart, weighed 3 to 1, meet at a quarter of the way."""
    camera, pose = lopsided_camera(80, 60), RigidTransform.identity()
    first, second = (look(plane((0.0, 0.0, 1.0), z), camera, pose) for z in (40.0, 40.4))
    three = RangeFrame(first.range, camera, pose, np.full((60, 80), 3.0))
    single = RangeFrame(second.range, camera, pose, np.ones((60, 80)))
    mesh = fuse([three, single], voxel=0.5)
    assert np.abs(mesh.vertices[:, 2] - 40.1).max() < 0.02
    assert (mesh.frames == 2).all()


def test_pixels_without_weight_do_not_count() -> None:
    camera = lopsided_camera(80, 60)
    frame = look(SLANT, camera, RigidTransform.identity())
    weight = np.ones((60, 80))
    weight[:, :30] = 0
    weight[:20] = np.nan
    mesh = fuse([RangeFrame(frame.range, camera, frame.world_from_camera, weight)])
    uv = camera.project(mesh.vertices)
    assert uv.min(0) == pytest.approx([30, 20], abs=1.5)
    assert (uv > [29.9, 19.9]).all()


def test_frames_counts_who_saw() -> None:
    """Two cameras side by side share the middle."""
    camera = lopsided_camera(80, 60)
    poses = [RigidTransform.of([0, 0, 0], [x, 0, 0]) for x in (-8.0, 8.0)]
    mesh = fuse([look(plane((0.0, 0.0, 1.0), 40.0), camera, pose) for pose in poses])
    both = np.ones(len(mesh.vertices), bool)
    for pose in poses:
        uv = camera.project(pose.inverse().apply(mesh.vertices))
        both &= ((uv >= 1) & (uv <= [78, 58])).all(1)
    assert (mesh.frames[both] == 2).all()
    assert (mesh.frames == 1).sum() > 0.2 * len(both)


def test_order_does_not_matter() -> None:
    """But for the rounding of sums in single precision."""
    rng = np.random.default_rng(1)
    frames = [noisy(frame, 1e-4, rng) for frame in inside_a_sphere()]
    one = fuse(frames)
    other = fuse(frames[::-1], voxel=voxel_size(frames))
    assert len(one.vertices) == len(other.vertices)
    distance, at = KDTree(one.vertices).query(other.vertices)
    assert distance.max() < 1e-3
    assert np.array_equal(one.frames[at], other.frames)


def test_the_unit_of_length_does_not_matter() -> None:
    """A solver measures in baselines until its end."""
    frames = inside_a_sphere(3)
    small = [
        RangeFrame(
            f.range / 6.3, f.camera,
            RigidTransform(f.world_from_camera.R, f.world_from_camera.t / 6.3),
        )
        for f in frames
    ]  # fmt: skip
    mm, units = fuse(frames), fuse(small)
    assert len(mm.vertices) == len(units.vertices)
    assert KDTree(mm.vertices).query(6.3 * units.vertices)[0].max() < 1e-3
    mm, units = fuse(frames, vertices=3000), fuse(small, vertices=3000)
    assert len(mm.vertices) == pytest.approx(len(units.vertices), rel=0.01)


def test_a_volume_grows_frame_by_frame() -> None:
    """What is taken out on the way is what fusing so far gives."""
    frames = inside_a_sphere(3)
    volume = Volume(voxel_size(frames))
    for k, frame in enumerate(frames, 1):
        volume.integrate(frame)
        so_far, at_once = surface_of(volume), fuse(frames[:k], voxel=volume.voxel)
        assert np.array_equal(so_far.vertices, at_once.vertices)
        assert np.array_equal(so_far.faces, at_once.faces)


def test_memory_follows_the_surface_and_not_the_frames() -> None:
    """Eleven layers of voxels of 14 bytes, twice that with whole blocks and room to grow."""
    frames = inside_a_sphere()
    volume = Volume(voxel_size(frames))
    for frame in frames:
        volume.integrate(frame)
    once = volume.bytes
    for frame in frames * 2:
        volume.integrate(frame)
    assert volume.bytes == once
    assert once < 14 * 2 * 11 * 4 * np.pi * (RADIUS / volume.voxel) ** 2


def test_decimation_keeps_shape_and_cleanness() -> None:
    frames = inside_a_sphere()
    whole = fuse(frames)
    for wanted in (len(whole.vertices) // 3, 2000):
        mesh = fuse(frames, vertices=wanted)
        check_clean(mesh)
        assert len(mesh.vertices) == pytest.approx(wanted, rel=0.03)
        normals, middles = face_normals(mesh)
        assert np.sum(normals * (np.array(CENTRE) - middles), axis=1).min() > 0.7 * RADIUS
        # A cap of N equal triangles on a sphere stands off its chord by about area / 2 R.
        sagitta = 4 * np.pi * RADIUS**2 / len(mesh.faces) / RADIUS
        assert np.abs(from_centre(mesh.vertices)).max() < sagitta
    assert len(fuse(frames, vertices=10**9).vertices) == len(whole.vertices)


def test_islands_go() -> None:
    """A speck before the wall, apart from it, and a wall of its own that is large enough."""
    camera, pose = lopsided_camera(100, 76), RigidTransform.identity()
    ranges = look(plane((0.0, 0.0, 1.0), 60.0), camera, pose).range
    ranges[10:19, 20:30] = 40.0
    ranges[30:60, 50:90] = 45.0
    mesh = fuse([RangeFrame(ranges, camera, pose)])
    r = np.linalg.norm(mesh.vertices, axis=1)
    assert not (np.abs(r - 40) < 2).any()
    assert (np.abs(r - 45) < 0.5).sum() > 300
    kept = fuse([RangeFrame(ranges, camera, pose)], smallest_island=0.0)
    assert (np.abs(np.linalg.norm(kept.vertices, axis=1) - 40) < 2).any()


def test_what_cannot_be_fused_is_said() -> None:
    camera, pose = lopsided_camera(40, 30), RigidTransform.identity()
    nothing = RangeFrame(np.full((30, 40), np.nan), camera, pose)
    with pytest.raises(ValueError, match="nothing to fuse"):
        fuse([nothing])
    with pytest.raises(ValueError, match="nothing to fuse"):
        fuse([])
    dots = np.full((30, 40), np.nan)
    dots[::2, ::2] = 30
    with pytest.raises(ValueError, match="no piece of surface"):
        fuse([RangeFrame(dots, camera, pose)])
    with pytest.raises(ValueError, match="the camera's"):
        RangeFrame(np.ones((40, 30)), camera, pose)
    with pytest.raises(ValueError, match="must be above zero"):
        Volume(0.0)
    with pytest.raises(ValueError, match="at least 4"):
        fuse([look(SLANT, camera, pose)], vertices=3)


def test_frames_that_saw_nothing_change_nothing() -> None:
    frames = inside_a_sphere(2)
    nothing = RangeFrame(
        np.full_like(frames[0].range, np.nan), frames[0].camera, frames[0].world_from_camera
    )
    assert np.array_equal(fuse([frames[0], nothing, frames[1]]).vertices, fuse(frames).vertices)


def test_gross_outliers_leave_no_spikes_and_few_holes() -> None:
    """A pixel apart from its neighbours is no part of a sheet, and mended if they agree."""
    rng = np.random.default_rng(2)
    frames = []
    for frame in inside_a_sphere():
        wild = rng.random(frame.range.shape) < 0.02
        ranges = np.where(wild, rng.uniform(5, 60, wild.shape), frame.range)
        frames.append(RangeFrame(ranges, frame.camera, frame.world_from_camera))
    mesh = fuse(frames)
    check_clean(mesh)
    assert np.abs(from_centre(mesh.vertices)).max() < voxel_size(frames)
    assert len(mesh.vertices) > 0.97 * len(fuse(inside_a_sphere()).vertices)

"""Range images of single frames into one surface: ICP by small_gicp, TSDF by Open3D."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.registration import RangeImage, Registration, register_frames
from mitsuba_endo.records.calibration import SurfaceEstimate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Fusion:
    """Settings, tuned on captures that are not part of the comparison."""

    voxel: float = 0.8
    """Side of a voxel, mm."""
    truncation: float = 5.0
    """Of the signed distance, voxels."""
    views: float = 0.5
    """Frames that must have seen a piece of surface, at least."""
    reach: float = 3.0
    """Distance within which ICP pairs points, mm."""
    steepest: float = 3.0
    """Slope of the range against the ray's angle (tangent) beyond which a pixel is left out: the
    bridges over depth steps."""
    free_scale: bool = True
    """Whether every frame's scale is found by the registration, or is the first one's."""


def fuse(ranges: list[Floats], camera: CameraModel, how: Fusion) -> SurfaceEstimate:
    """Register the frames and merge them.

    The start of ICP is the package's own registration, which needs no guess; a frame that it cannot
    place is left out, and all but the first where that is the one.

    Args:
        ranges: (H, W) along the unit camera rays, mm, NaN = not seen.
        camera: without distortion.
        how: settings.

    Returns:
        The surface in the first camera's frame, mm.
    """
    rays = camera.grid_rays
    ranges = [_without_bridges(r, camera, how.steepest) for r in ranges]
    placed = register_frames([RangeImage(rays, r, camera) for r in ranges])
    clouds = [(rays * r[..., None])[np.isfinite(r)] for r in ranges]
    first = placed[0]
    scales = [p.scale / first.scale if how.free_scale else 1.0 for p in placed]
    poses: dict[int, RigidTransform] = {0: RigidTransform.identity()}
    model = clouds[0]
    for k, place in enumerate(placed):
        if k and place.reliable and first.reliable:
            poses[k] = _icp(model, scales[k] * clouds[k], _seen_from(first, place), how.reach)
            model = np.concatenate([model, poses[k].apply(scales[k] * clouds[k])])
    depths = [
        scales[k] * ranges[k] * rays[..., 2] if k else ranges[0] * rays[..., 2] for k in poses
    ]
    return _merged(depths, list(poses.values()), camera, how)


def _seen_from(first: Registration, other: Registration) -> RigidTransform:
    moved = first.world_from_camera.inverse() @ other.world_from_camera
    return RigidTransform(moved.R, moved.t / first.scale)


def _without_bridges(image: Floats, camera: CameraModel, steepest: float) -> Floats:
    step = 1 / camera.K[0, 0]
    dy, dx = np.gradient(image)
    return np.where(np.hypot(dx, dy) < steepest * step * image, image, np.nan)


def _icp(target: Floats, source: Floats, guess: RigidTransform, reach: float) -> RigidTransform:
    import small_gicp  # pyright: ignore[reportMissingImports]

    found: Any = small_gicp.align(
        target, source, guess.matrix(), registration_type="GICP", downsampling_resolution=0.6,
        max_correspondence_distance=reach, max_iterations=60, rotation_epsilon=1e-5,
        translation_epsilon=1e-4,
    )  # fmt: skip
    T = found.T_target_source
    return RigidTransform.of(T[:3, :3], T[:3, 3])


def _merged(
    depths: list[Floats], poses: list[RigidTransform], camera: CameraModel, how: Fusion
) -> SurfaceEstimate:
    import open3d as o3d  # pyright: ignore[reportMissingImports]

    core: Any = o3d.core
    geometry: Any = o3d.t.geometry
    grid: Any = geometry.VoxelBlockGrid(
        attr_names=("tsdf", "weight", "color"), attr_dtypes=(core.float32,) * 3,
        attr_channels=((1), (1), (3)), voxel_size=how.voxel, block_resolution=8, block_count=20_000,
        device=core.Device("CPU:0"),
    )  # fmt: skip
    K = core.Tensor(np.asarray(camera.K, np.float64))
    for depth, pose in zip(depths, poses, strict=True):
        image = geometry.Image(core.Tensor(np.nan_to_num(depth).astype(np.float32)))
        extrinsic = core.Tensor(pose.inverse().matrix())
        arguments = (K, extrinsic, 1.0, 1000.0, float(how.truncation))
        blocks = grid.compute_unique_block_coordinates(image, *arguments)
        grid.integrate(blocks, image, *arguments)
    mesh = grid.extract_triangle_mesh(how.views)
    vertices = mesh.vertex.positions.numpy().astype(np.float64)
    return SurfaceEstimate(vertices, mesh.triangle.indices.numpy().astype(np.int64))

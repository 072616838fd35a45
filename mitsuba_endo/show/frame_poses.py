"""Cameras, projectors, their frusta and rays in the frame of the first camera."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import FrameMaps
from ..records.solution import Frame, Solution

Floats = NDArray[np.float64]

REACH = 0.4
"""Length of the drawn frusta over the surface's distance."""
_AXIS = np.array([[0.0, 0.0, 1.0]])
"""(1, 3) direction of a device's optical axis, z."""
_PARALLEL = 1e-4
"""Sine of the angle between two rays below which they meet nowhere that could be drawn."""


@dataclass(frozen=True, eq=False)
class FramePoses:
    """Where one frame's camera and projector are; None where that could not be determined."""

    name: str
    first_from_camera: RigidTransform | None
    first_from_projector: RigidTransform | None


def frame_poses(solution: Solution) -> list[FramePoses]:
    """Return the places of all frames, lengths in the solution's unit."""
    first = solution.frames[0].world_from_camera.to_transform()
    out = []
    for i, frame in enumerate(solution.frames):
        camera = frame.world_from_camera.to_transform()
        if i == 0:
            camera = first = first or RigidTransform.identity()
        pose = frame.projector_from_camera.to_transform()
        first_from_camera = None if camera is None or first is None else first.inverse() @ camera
        first_from_projector = None
        if first_from_camera is not None and pose is not None:
            first_from_projector = first_from_camera @ pose.inverse()
        out.append(FramePoses(frame.name, first_from_camera, first_from_projector))
    return out


def frame_projector(solution: Solution, frame: Frame) -> ProjectorModel | None:
    """Return a frame's projector, whose focal length may be its own; None where it is unknown."""
    projector = solution.projector
    if frame.focal is not None:
        projector = projector.model_copy(update={"focal": frame.focal})
    return projector.to_model()


def camera_corners(camera: CameraModel) -> Floats:
    """Return the directions (4, 3) of the image's corners in the camera's frame."""
    w, h = camera.width - 1, camera.height - 1
    return camera.rays(np.array([[0, 0], [w, 0], [w, h], [0, h]], float))


def solution_corners(solution: Solution, frame: Frame) -> Floats:
    """Return the directions (4, 3) of the pattern's corners, or (1, 3) the axis where unknown."""
    model = frame_projector(solution, frame)
    width, height = solution.projector.width, solution.projector.height
    if model is None or width is None or height is None:
        return _AXIS
    return pattern_corners(model, (width, height))


def pattern_corners(model: ProjectorModel, size: tuple[int, int]) -> Floats:
    """Return the directions (4, 3) of the corners of a pattern, or (1, 3) the axis.

    A wide pattern's corners may lie beyond the law's range: they are then drawn nearer to the
    middle, as far out as all four exist.
    """
    w, h = size[0] - 1, size[1] - 1
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]], float)
    middle = np.array([w / 2, h / 2])
    for share in np.arange(10, 4, -1) / 10:
        directions = model.unproject(middle + share * (corners - middle))
        if np.isfinite(directions).all():
            return directions
    return _AXIS


def pyramid(first_from_own: RigidTransform, directions: Floats, reach: float) -> Floats:
    """Return the edges (2 N, 2, 3) of a frustum: from the apex to the corners, and around."""
    tips = first_from_own.apply(directions * reach)
    spokes = np.stack([np.broadcast_to(first_from_own.t, tips.shape), tips], 1)
    return np.concatenate([spokes, np.stack([tips, np.roll(tips, -1, axis=0)], 1)])


@dataclass(frozen=True, eq=False)
class Rays:
    """Some correspondences of a frame: where both rays pass each other most closely."""

    pixels: NDArray[np.int64]
    """(N, 2) camera pixels (x, y)."""
    camera: Floats
    """(N, 2, 3) from the camera's centre to that place, first camera's frame."""
    projector: Floats
    """(N, 2, 3) from the projector's centre, likewise; the ends' gap is the epipolar error."""


def correspondence_rays(
    solution: Solution, camera: CameraModel, maps: FrameMaps, at: FramePoses, count: int
) -> Rays | None:
    """Return about ``count`` used correspondences, evenly spread over the image.

    None where the projector is not known. The observed coordinates are drawn, not the rendered.
    """
    model = frame_projector(solution, solution.frames[_index(solution, maps.name)])
    if model is None or at.first_from_camera is None or at.first_from_projector is None:
        return None
    pixels = _spread(maps.used, count)
    q = maps.observed[pixels[:, 1], pixels[:, 0]].astype(np.float64)
    a = at.first_from_camera.rotate(camera.rays(pixels.astype(float)))
    b = at.first_from_projector.rotate(model.unproject(q))
    between = at.first_from_projector.t - at.first_from_camera.t
    # Nearest points of the lines s a and between + u b.
    cosine = np.sum(a * b, -1)
    sine2 = np.maximum(1 - cosine**2, _PARALLEL**2)
    s = (a @ between - cosine * (b @ between)) / sine2
    u = (cosine * (a @ between) - b @ between) / sine2
    kept = (s > 0) & (u > 0) & (sine2 > _PARALLEL**2)
    ends = [
        np.stack([np.broadcast_to(origin, d.shape), origin + length[:, None] * d], 1)[kept]
        for origin, d, length in (
            (at.first_from_camera.t, a, s), (at.first_from_projector.t, b, u),
        )
    ]  # fmt: skip
    return Rays(pixels[kept], *ends)


def _index(solution: Solution, name: str) -> int:
    return next(i for i, frame in enumerate(solution.frames) if frame.name == name)


def _spread(mask: NDArray[np.bool_], count: int) -> NDArray[np.int64]:
    """Return about ``count`` pixels (x, y) of a mask on a square grid."""
    step = max(1, int(np.sqrt(mask.sum() / max(count, 1))))
    grid = np.zeros_like(mask)
    grid[step // 2 :: step, step // 2 :: step] = True
    y, x = np.nonzero(mask & grid)
    return np.stack([x, y], -1)

"""COLMAP sparse model, text form."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...files import atomic_folder
from ...folder_mark import Kind
from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...reading.regular import is_file
from ...records.solution import Solution
from ...records.surface import load_surface, own_surface_name
from ..map_names import observed_names
from .registry import register_exporter
from .required_values import (
    camera_in,
    camera_pose,
    pinhole_only,
    projector_pose,
    required_camera,
    required_projector,
    required_size,
)
from .tracks import Sightings, sightings

_PIXEL_CENTRE = 0.5
"""COLMAP's first pixel spans 0 to 1; here its centre is 0."""
_FULL_OPENCV = 8
"""Coefficients of COLMAP's model of that name: k1, k2, p1, p2, k3 to k6."""
_MODELS = {"opencv": "FULL_OPENCV", "opencv_fisheye": "OPENCV_FISHEYE"}
_COEFFICIENTS = {"FULL_OPENCV": _FULL_OPENCV, "OPENCV_FISHEYE": 4}


@register_exporter(
    "colmap", "folder with a sparse model in text form; pinhole projectors only", Kind.COLMAP
)
def write_colmap(solution: Solution, folder: Path, path: Path) -> None:
    """Write cameras.txt, images.txt and points3D.txt.

    The projector is a second camera (``FULL_OPENCV``); each frame is two images, ``NAME`` and
    ``projector/NAME``. Points are the surfaces' vertices in the world's frame. Their tracks are the
    used correspondences at their pixels: in the camera's image the pixel itself, in the projector's
    the observed coordinate, which alone has noise; the error is in pattern pixels.

    Raises:
        InputError: a value was not determined, COLMAP has no camera like the camera's model or
            the projector's law (it has ``pinhole`` only), or the folder cannot be written.
    """
    pinhole_only(solution, "COLMAP")
    if solution.surface is None:
        raise InputError("surface is missing", "solution.json", "calibrate again")
    points, frame_sightings = _points(solution, folder)
    cameras, images = _cameras(solution), _images(solution, frame_sightings)
    with atomic_folder(path, Kind.COLMAP) as aside:
        _write(aside / "cameras.txt", cameras)
        _write(aside / "images.txt", images)
        _write(aside / "points3D.txt", _point_lines(points, frame_sightings))


def _points(solution: Solution, folder: Path) -> tuple[NDArray[np.float64], list[Sightings]]:
    """Return the vertices of all surfaces in the world's frame, and where every frame sees them."""
    camera, frames = required_camera(solution), solution.frames
    poses = [camera_pose(frame) for frame in frames]
    own = [folder / own_surface_name(k) for k in range(1, len(frames))]
    paths = [folder / str(solution.surface), *(path for path in own if is_file(path))]
    surfaces = [
        pose.apply(load_surface(path).vertices) for path, pose in zip(paths, poses, strict=False)
    ]
    starts = np.cumsum([0, *(len(s) for s in surfaces)])
    maps = observed_names([frame.name for frame in frames])
    frame_sightings = []
    for k, (frame, name) in enumerate(zip(frames, maps, strict=True)):
        surface = k if len(surfaces) > 1 else 0
        sighted = sightings(
            surfaces[surface], frame, camera, required_projector(solution, frame),
            poses[k].inverse(), projector_pose(frame), folder / name,
        )  # fmt: skip
        frame_sightings.append(replace(sighted, points=sighted.points + starts[surface]))
    return np.concatenate(surfaces), frame_sightings


def _point_lines(points: NDArray[np.float64], frame_sightings: list[Sightings]) -> list[str]:
    """Return a line a point: number, place, grey, mean error, and images with their points."""
    tracks: list[list[str]] = [[] for _ in points]
    errors: list[list[float]] = [[] for _ in points]
    for k, sighted in enumerate(frame_sightings):
        for i, (point, error) in enumerate(zip(sighted.points, sighted.error, strict=True)):
            tracks[point] += [f"{2 * k + 1} {i}", f"{2 * k + 2} {i}"]
            errors[point] += [0.0, float(error)]
    means = [float(np.mean(e)) if e else -1.0 for e in errors]
    return [
        f"{i + 1} {x!r} {y!r} {z!r} 128 128 128 {means[i]!r} {' '.join(tracks[i])}"
        for i, (x, y, z) in enumerate(points.tolist())
    ]


def _cameras(solution: Solution) -> list[str]:
    """Return the camera as camera 1 and the projector of frame i as camera i + 2."""
    lines = [_camera_line(required_camera(solution))]
    width, height = required_size(solution)
    for i, frame in enumerate(solution.frames):
        projector = required_projector(solution, frame)
        values = _numbers(_projector_values(projector))
        lines.append(f"{i + 2} FULL_OPENCV {width} {height} {values}")
    return lines


def _camera_line(camera: CameraModel) -> str:
    kind = camera_in(camera, _MODELS, "COLMAP")
    count = _COEFFICIENTS[kind]
    K = camera.K
    centre = K[0, 2] + _PIXEL_CENTRE, K[1, 2] + _PIXEL_CENTRE
    values = [K[0, 0], K[1, 1], *centre, *_padded(camera.distortion, count)]
    return f"1 {kind} {camera.width} {camera.height} {_numbers(values)}"


def _projector_values(projector: ProjectorModel) -> list[float]:
    cx, cy = projector.centre
    return [
        projector.focal, projector.focal * projector.aspect, cx + _PIXEL_CENTRE,
        cy + _PIXEL_CENTRE, *_padded(projector.distortion.coefficients, _FULL_OPENCV),
    ]  # fmt: skip


def _images(solution: Solution, frame_sightings: list[Sightings]) -> list[str]:
    """Return two lines an image, the second of which holds its 2D points."""
    lines = []
    for i, (frame, sighted) in enumerate(zip(solution.frames, frame_sightings, strict=True)):
        camera_from_world = camera_pose(frame).inverse()
        projector_from_world = projector_pose(frame) @ camera_from_world
        name = frame.name.replace(" ", "_")
        camera = _image_line(2 * i + 1, camera_from_world, 1, name)
        projector = _image_line(2 * i + 2, projector_from_world, i + 2, f"projector/{name}")
        lines += [camera, _points_line(sighted.pixels, sighted.points)]
        lines += [projector, _points_line(sighted.q, sighted.points)]
    return lines


def _points_line(positions: NDArray[np.float64], points: NDArray[np.int64]) -> str:
    shifted = (positions + _PIXEL_CENTRE).tolist()
    return " ".join(f"{x!r} {y!r} {p + 1}" for (x, y), p in zip(shifted, points, strict=True))


def _image_line(number: int, pose: RigidTransform, camera: int, name: str) -> str:
    x, y, z, w = Rotation.from_matrix(pose.R).as_quat()
    return f"{number} {_numbers([w, x, y, z, *pose.t])} {camera} {name}"


def _padded(coefficients: Sequence[float], count: int) -> list[float]:
    return [*coefficients, *[0.0] * (count - len(coefficients))]


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

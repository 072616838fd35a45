"""COLMAP sparse model, text form."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...files import atomic_folder
from ...geometry.cameras import CameraModel
from ...geometry.laws import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...records.solution import Solution
from ...records.surface import load_surface
from .known import camera_pose, known_camera, known_projector, known_size, projector_pose
from .registry import register_exporter

_PIXEL_CENTRE = 0.5
"""COLMAP's first pixel spans 0 to 1; here its centre is 0."""
_FULL_OPENCV, _FISHEYE = 8, 4


@register_exporter("colmap", "folder with a sparse model in text form; pinhole projectors only")
def write_colmap(solution: Solution, folder: Path, path: Path) -> None:
    """Write cameras.txt, images.txt and points3D.txt.

    The projector is a second camera (``FULL_OPENCV``); each frame is two images, ``NAME`` and
    ``projector/NAME``. Points are the vertices of the first frame's surface in the world's frame,
    without tracks: the correspondences are dense and stay in their maps.

    Raises:
        InputError: a value was not determined, the projector's law is not ``pinhole``, which is
            the only one that COLMAP's cameras express, or the folder cannot be written.
    """
    if solution.projector.law != "pinhole":
        raise InputError(
            f"COLMAP has no camera like the law {solution.projector.law}", "projector.law",
            "use --format opencv",
        )  # fmt: skip
    if solution.surface is None:
        raise InputError("surface is missing", "solution.json", "calibrate again")
    world = camera_pose(solution.frames[0])
    points = world.apply(load_surface(folder / solution.surface).vertices)
    cameras, images = _cameras(solution), _images(solution)
    with atomic_folder(path) as aside:
        _write(aside / "cameras.txt", cameras)
        _write(aside / "images.txt", images)
        _write(
            aside / "points3D.txt",
            [f"{i} {x!r} {y!r} {z!r} 128 128 128 -1" for i, (x, y, z) in _numbered(points)],
        )


def _cameras(solution: Solution) -> list[str]:
    """Return the camera as camera 1 and the projector of frame i as camera i + 2."""
    lines = [_camera_line(known_camera(solution))]
    width, height = known_size(solution)
    for i, frame in enumerate(solution.frames):
        projector = known_projector(solution, frame)
        values = _numbers(_projector_values(projector))
        lines.append(f"{i + 2} FULL_OPENCV {width} {height} {values}")
    return lines


def _camera_line(camera: CameraModel) -> str:
    fisheye = camera.model == "opencv_fisheye"
    kind, count = ("OPENCV_FISHEYE", _FISHEYE) if fisheye else ("FULL_OPENCV", _FULL_OPENCV)
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


def _images(solution: Solution) -> list[str]:
    """Return two lines an image, the second of which, its 2D points, is empty."""
    lines = []
    for i, frame in enumerate(solution.frames):
        camera_from_world = camera_pose(frame).inverse()
        projector_from_world = projector_pose(frame) @ camera_from_world
        name = frame.name.replace(" ", "_")
        lines += [_image_line(2 * i + 1, camera_from_world, 1, name), ""]
        projector = _image_line(2 * i + 2, projector_from_world, i + 2, f"projector/{name}")
        lines += [projector, ""]
    return lines


def _image_line(number: int, pose: RigidTransform, camera: int, name: str) -> str:
    x, y, z, w = Rotation.from_matrix(pose.R).as_quat()
    return f"{number} {_numbers([w, x, y, z, *pose.t])} {camera} {name}"


def _padded(coefficients: Sequence[float], count: int) -> list[float]:
    return [*coefficients, *[0.0] * (count - len(coefficients))]


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _numbered(points: np.ndarray) -> enumerate[list[float]]:
    return enumerate(points.tolist(), start=1)


def _write(path: Path, lines: list[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

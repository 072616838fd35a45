"""OpenCV FileStorage, as ``cv2.stereoCalibrate``'s samples write it."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...files import atomic_path
from ...geometry.arrays import Array
from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...records.solution import Frame, Solution
from .registry import register_exporter
from .required_values import (
    camera_in,
    camera_pose,
    projector_pose,
    required_camera,
    required_projector,
    required_size,
)

_SUFFIXES = (".yaml", ".yml", ".xml", ".json")
_MODELS = {"opencv": "calib3d", "opencv_fisheye": "fisheye", "omni": "omnidir"}
"""OpenCV's module for each camera model."""


@register_exporter("opencv", "FileStorage file: matrices, distortion, R, T")
def write_opencv(solution: Solution, folder: Path, path: Path) -> None:
    """Write camera, projector and poses for ``cv2.FileStorage``.

    ======================================  =======================================================
    camera_matrix, distortion_coefficients  of the camera, with image_width, image_height and
                                            fisheye_model, and xi if it is ``omnidir``'s; a rig
                                            file can name this file as camera
    projector_matrix                        [[f, 0, cx], [0, f aspect, cy], [0, 0, 1]] of the first
                                            frame, pattern pixels, with projector_width and _height
    projector_law                           to what the matrix is applied: ``pinhole``, (x/z, y/z)
                                            as OpenCV does; ``direction_cosine``, (x, y)/|X|
    projector_distortion_coefficients       k1, k2, p1, p2, k3 on those coordinates
    R, T                                    of the first frame, X_projector = R X_camera + T
    frames                                  of every frame: name, R, T, projector_matrix, and
                                            world_R, world_T with X_world = world_R X_camera +
                                            world_T
    units                                   of T: ``mm`` or ``baseline``
    ======================================  =======================================================

    Raises:
        InputError: a value was not determined, OpenCV has no such camera model, the suffix is not
            one of FileStorage's, or the file cannot be written.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(
            f"unknown kind of file '{path.suffix}'", str(path), f"end it in {', '.join(_SUFFIXES)}"
        )
    camera, size = required_camera(solution), required_size(solution)
    poses = [(projector_pose(f), camera_pose(f)) for f in solution.frames]
    projectors = [required_projector(solution, f) for f in solution.frames]
    kind = camera_in(camera, _MODELS, "OpenCV")
    # In memory: to a full disk OpenCV writes half of it and says nothing.
    how = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY
    storage = cv2.FileStorage(path.suffix.lower(), how)
    storage.write("units", solution.units)
    storage.write("image_width", camera.width)
    storage.write("image_height", camera.height)
    storage.write("fisheye_model", int(kind == "fisheye"))
    storage.write("camera_matrix", np.asarray(camera.K, np.float64))
    _write_lens(storage, camera, kind)
    storage.write("projector_law", projectors[0].law)
    storage.write("projector_width", size[0])
    storage.write("projector_height", size[1])
    storage.write("projector_matrix", projector_matrix(projectors[0]))
    distortion = _row(projectors[0].distortion.coefficients, 5)
    storage.write("projector_distortion_coefficients", distortion)
    storage.write("R", poses[0][0].R)
    storage.write("T", poses[0][0].t.reshape(3, 1))
    _write_frames(storage, solution.frames, projectors, poses)
    text = storage.releaseAndGetString()
    with atomic_path(path) as aside:
        aside.write_text(text, encoding="utf-8")


def _write_lens(storage: cv2.FileStorage, camera: CameraModel, kind: str) -> None:
    """Write the coefficients; OpenCV's ``omnidir`` has its xi apart, and no k3."""
    coefficients = [float(c) for c in camera.distortion]
    if kind == "omnidir":
        xi, *coefficients = coefficients
        if any(coefficients[4:]):
            raise InputError("omnidir has no k3", "camera.distortion", "use --format mitsuba")
        storage.write("xi", np.array([[xi]]))
        coefficients = coefficients[:4]
    row = _row(coefficients, 5 if kind == "calib3d" else 4)
    storage.write("distortion_coefficients", row)


def _write_frames(
    storage: cv2.FileStorage,
    frames: list[Frame],
    projectors: list[ProjectorModel],
    poses: list[tuple[RigidTransform, RigidTransform]],
) -> None:
    storage.startWriteStruct("frames", cv2.FileNode_SEQ)
    for frame, projector, (pose, world) in zip(frames, projectors, poses, strict=True):
        storage.startWriteStruct("", cv2.FileNode_MAP)
        storage.write("name", frame.name)
        storage.write("R", pose.R)
        storage.write("T", pose.t.reshape(3, 1))
        storage.write("projector_matrix", projector_matrix(projector))
        storage.write("world_R", world.R)
        storage.write("world_T", world.t.reshape(3, 1))
        storage.endWriteStruct()
    storage.endWriteStruct()


def projector_matrix(projector: ProjectorModel) -> NDArray[np.float64]:
    """Return the (3, 3) matrix from normalised to pattern coordinates, pattern pixels."""
    f, (cx, cy) = projector.focal, projector.centre
    return np.array([[f, 0, cx], [0, f * projector.aspect, cy], [0, 0, 1]], np.float64)


def _row(coefficients: Sequence[Array], at_least: int) -> NDArray[np.float64]:
    """Pad with zeros to the length that OpenCV's functions accept."""
    values = [float(c) for c in coefficients]
    return np.array([values + [0.0] * (at_least - len(values))], np.float64)

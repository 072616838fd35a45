"""ROS: camera_info files of camera and projector, and the transform between them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...files import atomic_folder
from ...folder_mark import Kind
from ...geometry.arrays import Array
from ...records.solution import Solution
from .opencv import projector_matrix
from .registry import register_exporter
from .required_values import (
    camera_in,
    metres,
    pinhole_only,
    projector_pose,
    required_camera,
    required_projector,
    required_size,
)

_MODELS = {"opencv": "plumb_bob", "opencv_fisheye": "equidistant"}
_COUNTS = {"plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}


@register_exporter(
    "ros", "folder with camera_info of camera and projector; pinhole projectors only", Kind.ROS
)
def write_ros(solution: Solution, folder: Path, path: Path) -> None:
    """Write camera.yaml, projector.yaml (camera_info) and transform.yaml, of the first frame.

    transform.yaml is a ``geometry_msgs/TransformStamped``: the projector's pose in the frame
    ``camera`` (X_camera = T X_projector), in metres, or in baselines if the solution is up to
    scale. Optical frames: x right, y down, z forward.

    Raises:
        InputError: a value was not determined, ROS has no camera like the camera's model or the
            projector's law, or the folder cannot be written.
    """
    pinhole_only(solution, "ROS")
    camera, first = required_camera(solution), solution.frames[0]
    lens = camera_in(camera, _MODELS, "ROS")
    lens = "rational_polynomial" if lens == "plumb_bob" and any(camera.distortion[5:]) else lens
    projector, size = required_projector(solution, first), required_size(solution)
    pose = projector_pose(first).inverse()
    files = {
        "camera.yaml": _info(
            "camera", (camera.width, camera.height), np.asarray(camera.K), lens, camera.distortion
        ),
        "projector.yaml": _info(
            "projector", size, projector_matrix(projector), "plumb_bob",
            projector.distortion.coefficients,
        ),
        "transform.yaml": {
            "header": {"frame_id": "camera"},
            "child_frame_id": "projector",
            "transform": {
                "translation": dict(zip("xyz", metres(solution, pose), strict=True)),
                "rotation": dict(
                    zip("xyzw", Rotation.from_matrix(pose.R).as_quat().tolist(), strict=True)
                ),
            },
        },
    }  # fmt: skip
    with atomic_folder(path, Kind.ROS) as aside:
        for name, data in files.items():
            text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=200)
            (aside / name).write_text(text, encoding="utf-8")


def _info(
    name: str,
    size: tuple[int, int],
    K: NDArray[np.float64],
    lens: str,
    coefficients: Sequence[Array],
) -> dict[str, Any]:
    """Return what ``camera_info_manager`` reads; without rectification P is K."""
    D = [float(c) for c in coefficients]
    count = _COUNTS[lens]
    if any(D[count:]):
        raise InputError(f"ROS's {lens} has {count} coefficients", name, "use --format opencv")
    P = np.column_stack([K, np.zeros(3)])
    return {
        "image_width": size[0], "image_height": size[1], "camera_name": name,
        "camera_matrix": _matrix(K), "distortion_model": lens,
        "distortion_coefficients": _matrix(np.array([(D + [0.0] * count)[:count]])),
        "rectification_matrix": _matrix(np.eye(3)), "projection_matrix": _matrix(P),
    }  # fmt: skip


def _matrix(values: NDArray[np.float64]) -> dict[str, Any]:
    rows, columns = values.shape
    return {"rows": rows, "cols": columns, "data": np.asarray(values, float).ravel().tolist()}

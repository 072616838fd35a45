"""Kalibr's camchain."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from ...errors import InputError
from ...files import atomic_path
from ...geometry.arrays import Array
from ...geometry.cameras import CameraModel
from ...records.solution import Solution
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

_MODELS = {
    "opencv": "radtan", "opencv_fisheye": "equidistant", "omni": "radtan", "double_sphere": "none",
}  # fmt: skip
_LEADING = {"omni": ("omni", 1), "double_sphere": ("ds", 2)}
"""Kalibr's camera model, and how many coefficients it takes into ``intrinsics``."""
_LENS = 4
"""Coefficients of each of Kalibr's distortion models."""


@register_exporter("kalibr", "camchain.yaml with camera and projector; pinhole projectors only")
def write_kalibr(solution: Solution, folder: Path, path: Path) -> None:
    """Write the camera as cam0 and the first frame's projector as cam1.

    ``T_cn_cnm1`` of cam1 is X_projector = T X_camera with lengths in metres, or in baselines if the
    solution is up to scale.

    Raises:
        InputError: a value was not determined, Kalibr has no camera like the camera's model, a
            coefficient or the projector's law, or the file cannot be written.
    """
    pinhole_only(solution, "Kalibr")
    camera, first = required_camera(solution), solution.frames[0]
    projector, size = required_projector(solution, first), required_size(solution)
    pose = projector_pose(first)
    T = pose.matrix()
    T[:3, 3] = metres(solution, pose)
    (cx, cy), f = projector.centre, projector.focal
    second = _camera(
        "pinhole", [f, f * projector.aspect, cx, cy], "radtan",
        _four(projector.distortion.coefficients, "projector.distortion"), size, "projector",
    ) | {"T_cn_cnm1": T.tolist(), "cam_overlaps": [0]}  # fmt: skip
    chain = {"cam0": _first(camera) | {"cam_overlaps": [1]}, "cam1": second}
    with atomic_path(path) as aside:
        text = yaml.safe_dump(chain, sort_keys=False, default_flow_style=None, width=200)
        aside.write_text(text, encoding="utf-8")


def _first(camera: CameraModel) -> dict[str, Any]:
    lens = camera_in(camera, _MODELS, "Kalibr")
    kind, count = _LEADING.get(camera.model, ("pinhole", 0))
    leading = [float(c) for c in camera.distortion[:count]]
    K = camera.K
    intrinsics = [*leading, K[0, 0], K[1, 1], K[0, 2], K[1, 2]]
    rest = [] if lens == "none" else _four(camera.distortion[count:], "camera.distortion")
    return _camera(kind, intrinsics, lens, rest, (camera.width, camera.height), "camera")


def _camera(
    kind: str,
    intrinsics: Sequence[Array],
    lens: str,
    coefficients: list[float],
    size: tuple[int, int],
    name: str,
) -> dict[str, Any]:
    return {
        "camera_model": kind, "intrinsics": [float(v) for v in intrinsics],
        "distortion_model": lens, "distortion_coeffs": coefficients, "resolution": list(size),
        "rostopic": f"/{name}/image_raw",
    }  # fmt: skip


def _four(coefficients: Sequence[Array], where: str) -> list[float]:
    """Return the coefficients that Kalibr's distortion models have.

    Raises:
        InputError: there are more.
    """
    values = [float(c) for c in coefficients]
    if any(values[_LENS:]):
        raise InputError("Kalibr has four coefficients only", where, "use --format opencv or ros")
    return (values + [0.0] * _LENS)[:_LENS]

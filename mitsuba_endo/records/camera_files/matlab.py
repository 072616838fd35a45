"""MATLAB's ``cameraParameters`` or ``cameraIntrinsics``, written as JSON or YAML."""

from .camera_file import CameraFile, camera_file, matrix, numbers
from .document import Document
from .registry import register_format

_FIRST_PIXEL = 1.0
"""MATLAB's first pixel has its centre at (1, 1)."""


def _matches(document: Document) -> bool:
    return "RadialDistortion" in document.data


@register_format("MATLAB cameraParameters", _matches)
def read(document: Document) -> CameraFile:
    """Read FocalLength and PrincipalPoint, or IntrinsicMatrix, which MATLAB keeps transposed."""
    data, where = document.data, document.where
    if "FocalLength" in data:
        fx, fy = numbers(data["FocalLength"], f"{where}: FocalLength")
        cx, cy = numbers(data["PrincipalPoint"], f"{where}: PrincipalPoint")
    elif "IntrinsicMatrix" in data:
        fx, _, _, _, fy, _, cx, cy, _ = numbers(
            data["IntrinsicMatrix"], f"{where}: IntrinsicMatrix"
        )
    else:
        fx, _, cx, _, fy, cy, *_ = numbers(data["K"], f"{where}: K")
    radial = numbers(data["RadialDistortion"], f"{where}: RadialDistortion")
    tangential = numbers(data.get("TangentialDistortion", [0, 0]), f"{where}: TangentialDistortion")
    size = [int(n) for n in numbers(data.get("ImageSize", []), f"{where}: ImageSize")]
    return camera_file(
        matrix(fx, fy, cx - _FIRST_PIXEL, cy - _FIRST_PIXEL),
        [*radial[:2], *tangential, *radial[2:]],
        (size[1], size[0]) if len(size) == 2 else None,
        "",
        where,
    )

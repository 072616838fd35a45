"""MATLAB's ``cameraParameters`` or ``cameraIntrinsics``, written as JSON or YAML."""

from ...errors import InputError
from .camera_file import CameraFile, camera_file, matrix, numbers, pixels, square
from .document import Document
from .registry import register_format

_FIRST_PIXEL = 1.0
"""MATLAB's first pixel has its centre at (1, 1)."""


def _matches(document: Document) -> bool:
    return "RadialDistortion" in document.data


@register_format("MATLAB cameraParameters", _matches)
def read(document: Document) -> CameraFile:
    """Read FocalLength and PrincipalPoint, or IntrinsicMatrix, which MATLAB keeps transposed.

    Raises:
        InputError: a part is missing or no number, or the axes are skewed.
    """
    data, where = document.data, document.where
    (skew,) = numbers(data.get("Skew", 0.0), f"{where}: Skew", 1)
    if "FocalLength" in data:
        fx, fy = numbers(data["FocalLength"], f"{where}: FocalLength", 2)
        cx, cy = numbers(data["PrincipalPoint"], f"{where}: PrincipalPoint", 2)
    elif "IntrinsicMatrix" in data:
        (fx, _, _), (skew, fy, _), (cx, cy, _) = square(
            data["IntrinsicMatrix"], f"{where}: IntrinsicMatrix"
        )
    elif "K" in data:
        (fx, skew, cx), (_, fy, cy), _ = square(data["K"], f"{where}: K")
    else:
        raise InputError("FocalLength is missing", where, "export it again")
    if skew:
        raise InputError(f"has a skew of {skew:g}", where, "calibrate without skew")
    radial = numbers(data["RadialDistortion"], f"{where}: RadialDistortion")
    tangential = numbers(data.get("TangentialDistortion", [0, 0]), f"{where}: TangentialDistortion")
    size = pixels(data["ImageSize"], f"{where}: ImageSize") if data.get("ImageSize") else None
    return camera_file(
        matrix(fx, fy, cx - _FIRST_PIXEL, cy - _FIRST_PIXEL),
        [*radial[:2], *tangential, *radial[2:]],
        (size[1], size[0]) if size else None,
        "",
        where,
    )

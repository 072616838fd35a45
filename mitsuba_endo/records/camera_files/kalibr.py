"""Kalibr's camchain."""

import re

from ...errors import InputError
from .camera_file import CameraFile, Values, camera_file, matrix, numbers, pixels
from .document import Document
from .registry import chosen, register_format

_CAMERA = re.compile(r"cam\d+")
_KEYS = {
    "camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution", "rostopic",
    "cam_overlaps", "T_cn_cnm1", "T_cam_imu", "timeshift_cam_imu", "line_delay",
}  # fmt: skip
_LEADING = {"pinhole": 0, "omni": 1, "ds": 2}
"""Parameters before fu, fv, pu, pv in ``intrinsics`` of each camera model."""


def _cameras(document: Document) -> list[str]:
    return [
        name
        for name, value in document.data.items()
        if _CAMERA.fullmatch(str(name)) and isinstance(value, dict) and "intrinsics" in value
    ]


@register_format("Kalibr camchain", lambda document: bool(_cameras(document)))
def read(document: Document) -> CameraFile:
    """Read one camera: pinhole, omni or ds, with radtan, equidistant or none.

    Raises:
        InputError: another model, a key that is not known, or several cameras.
    """
    name = chosen(_cameras(document), document)
    camera, where = document.data[name], f"{document.where}: {name}"
    unknown = [key for key in camera if key not in _KEYS]
    if unknown:
        raise InputError(
            f"the key '{unknown[0]}' is not known and may be part of the camera", where, "remove it"
        )
    kind = str(camera.get("camera_model", ""))
    if kind not in _LEADING:
        raise InputError(
            f"the camera model '{kind}' is not known", where,
            f"calibrate with one of {', '.join(_LEADING)}",
        )  # fmt: skip
    values = numbers(camera["intrinsics"], f"{where}.intrinsics")
    if len(values) != _LEADING[kind] + 4:
        raise InputError(f"{kind} has {_LEADING[kind] + 4} intrinsics", where, "mend them")
    named, coefficients = _lens(kind, values[: _LEADING[kind]], camera, where)
    held = camera.get("resolution")
    size = pixels(held, f"{where}.resolution") if held else None
    return camera_file(matrix(*values[-4:]), coefficients, size, named, where)


def _lens(kind: str, leading: list[float], camera: Values, where: str) -> tuple[str, list[float]]:
    """Return the model's name and coefficients of camera model and distortion together.

    Raises:
        InputError: a pair of which this package has no model.
    """
    lens = str(camera.get("distortion_model", "none"))
    coefficients = numbers(camera.get("distortion_coeffs", []), f"{where}.distortion_coeffs")
    if lens == "none" and not any(coefficients):
        return kind, leading
    if kind == "ds" or (kind == "omni" and lens != "radtan"):
        raise InputError(f"no model of this package is {kind} with {lens}", where, "choose another")
    return (lens if kind == "pinhole" else kind), [*leading, *coefficients]

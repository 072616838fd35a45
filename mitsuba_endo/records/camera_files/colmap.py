"""COLMAP's cameras.txt."""

import re

from ...errors import InputError
from .camera_file import CameraFile, camera_file, matrix, numbers
from .document import Document
from .registry import chosen, register_format

_LINE = re.compile(r"^\s*(\d+)\s+([A-Z][A-Z_]+)\s+(\d{1,9})\s+(\d{1,9})((?:\s+[-+.\deE]+)+)\s*$")
"""A size of more than nine digits is none, and may be longer than Python turns into an int."""
_PIXEL_CENTRE = 0.5
"""COLMAP's first pixel spans 0 to 1; here its centre is 0."""
_MODELS = {
    "SIMPLE_PINHOLE": ("opencv", 1, ()),
    "PINHOLE": ("opencv", 2, ()),
    "SIMPLE_RADIAL": ("opencv", 1, (0,)),
    "RADIAL": ("opencv", 1, (0, 1)),
    "OPENCV": ("opencv", 2, (0, 1, 2, 3)),
    "FULL_OPENCV": ("opencv", 2, (0, 1, 2, 3, 4, 5, 6, 7)),
    "SIMPLE_RADIAL_FISHEYE": ("opencv_fisheye", 1, (0,)),
    "RADIAL_FISHEYE": ("opencv_fisheye", 1, (0, 1)),
    "OPENCV_FISHEYE": ("opencv_fisheye", 2, (0, 1, 2, 3)),
}
"""This package's model, how many focal lengths, and which of its coefficients follow the centre."""


def _lines(document: Document) -> dict[str, tuple[str, int, int, list[str]]]:
    """Return model, width, height and parameters by the cameras' numbers."""
    cameras = {}
    for line in document.text.splitlines():
        match = _LINE.match(line)
        if match and not line.lstrip().startswith("#"):
            number, model, width, height, rest = match.groups()
            cameras[number] = model, int(width), int(height), rest.split()
    return cameras


@register_format("COLMAP cameras.txt", lambda document: bool(_lines(document)))
def read(document: Document) -> CameraFile:
    """Read one camera.

    Raises:
        InputError: another model, another number of parameters, or several cameras.
    """
    cameras = _lines(document)
    number = chosen(list(cameras), document)
    kind, width, height, texts = cameras[number]
    where = f"{document.where}: camera {number}"
    if kind not in _MODELS:
        raise InputError(
            f"the camera model '{kind}' is not known", where,
            f"calibrate with one of {', '.join(_MODELS)}",
        )  # fmt: skip
    model, focals, coefficients = _MODELS[kind]
    count = focals + 2 + len(coefficients)
    if len(texts) != count:
        raise InputError(f"{kind} has {count} parameters, not {len(texts)}", where, "mend it")
    values = numbers(texts, where)
    fx, fy = values[0], values[focals - 1]
    cx, cy = (c - _PIXEL_CENTRE for c in values[focals : focals + 2])
    return camera_file(matrix(fx, fy, cx, cy), values[focals + 2 :], (width, height), model, where)

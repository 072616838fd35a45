"""Files with a key for each number: ORB-SLAM's ``Camera.fx``, and plain ``fx``, ``fy``, ..."""

import re

from ...errors import InputError
from .camera_file import CameraFile, Values, camera_file, matrix, numbers
from .document import Document
from .lenses import LENS_NAMES, lens_of, plain
from .matrices import (
    DISTORTION,
    HARMLESS,
    HEIGHT,
    MODEL,
    SIZE,
    WIDTH,
    content,
    find,
    image_size,
    matrix_key,
    model_name,
)
from .registry import register_format

_PREFIX = re.compile(r"^Camera1?\.(?=.)")
_OF_ORB_SLAM = (
    "bf", "rgb", "newwidth", "newheight", "rows", "cols", "overlappingbegin", "overlappingend",
)  # fmt: skip
_NEVER_OF_THE_LENS = {
    *HARMLESS, *MODEL, *WIDTH, *HEIGHT, *SIZE, *_OF_ORB_SLAM, "fisheyemodel",
}  # fmt: skip
_CENTRE = {"cx": ("cx", "ppx", "x0"), "cy": ("cy", "ppy", "y0")}


def _camera(document: Document) -> Values:
    """Return the camera's keys: those after ``Camera.``, or all where none is written so."""
    named = {_PREFIX.sub("", k): v for k, v in document.data.items() if _PREFIX.match(str(k))}
    if "type" in named:
        named["model"] = named.pop("type")
    return named or document.data


def _is_flat(document: Document) -> bool:
    data = _camera(document)
    return matrix_key(data) is None and all(
        isinstance(data.get(name), int | float) for name in ("fx", "fy")
    )


@register_format("fx, fy, cx, cy and coefficients one by one (ORB-SLAM and others)", _is_flat)
def read(document: Document) -> CameraFile:
    """Read a camera whose numbers have a key each.

    Raises:
        InputError: a centre is missing, or a key is not known.
    """
    data, where = _camera(document), document.where
    cx, cy = (find(data, names) for names in _CENTRE.values())
    if not cx or not cy:
        raise InputError("cx or cy is missing", where, "add it")
    named = model_name(data, where)
    names = LENS_NAMES[lens_of(named, where)]
    spelt = {plain(key): key for key in data}
    single = [spelt[plain(name)] for name in names if plain(name) in spelt]
    lens = find(data, (*DISTORTION, "coeffs"))
    used = {"fx", "fy", cx, cy, *single, *([lens] if lens else [])}
    unknown = [key for key in data if key not in used and plain(key) not in _NEVER_OF_THE_LENS]
    if unknown or (lens and single):
        raise InputError(
            f"the key '{(unknown or single)[0]}' beside {lens or 'fx'} is not known and may be "
            "part of the camera", where, "remove it if it is not",
        )  # fmt: skip
    if lens:
        coefficients = numbers(content(data[lens]), f"{where}: {lens}")
    else:
        values = [data.get(spelt.get(plain(name), ""), 0.0) for name in names]
        coefficients = numbers(values, f"{where}: {names[0]}", len(names))
    size = image_size(data, where)
    K = matrix(*numbers([data["fx"], data["fy"], data[cx], data[cy]], f"{where}: {cx}, {cy}", 4))
    return camera_file(K, coefficients, size, named, where)

"""Files that a scene asks for by description: ``shape:NAME?a=1&b=2``, ``pattern:NAME?...``.

A scene parameter with such a value stands for a file that is generated while the scene loads, so
that scenes need no files beside them and every shape parameter can be set from a command line.
"""

from pathlib import Path

import numpy as np

from ..description import read_description
from ..records.exr_files import write_exr
from ..shapes import make_shape
from .pattern import make_pattern


def generate(parameter: str, value: str, folder: Path) -> str:
    """Return ``value``, or the path of the file generated from it in ``folder``.

    Raises:
        InputError: the description names no such shape, pattern or parameter.
    """
    kind, colon, _ = value.partition(":")
    if not colon or kind not in ("shape", "pattern"):
        return value
    name, settings = read_description(value, kind, parameter)
    if kind == "shape":
        path = folder / f"{parameter}.ply"
        make_shape(name, **settings).save(path)
    else:
        path = folder / f"{parameter}.exr"
        image = make_pattern(name, **settings)
        write_exr(path, {c: image[..., i] for i, c in enumerate("RGB")})
    return str(path)


def describe(kind: str, name: str, **settings: float | str) -> str:
    """Return the description of a generated file, for use as a scene parameter."""
    query = "&".join(f"{k}={np.format_float_positional(v, trim='-') if isinstance(v, float) else v}"
                     for k, v in settings.items())  # fmt: skip
    return f"{kind}:{name}?{query}" if query else f"{kind}:{name}"

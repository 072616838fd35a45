"""Names that programs give to lens models, and the coefficients that this package has of each."""

import re
from collections.abc import Sequence

from ...errors import InputError
from ...geometry.cameras import CAMERAS

LENS_NAMES = {
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
               "s1", "s2", "s3", "s4", "tau_x", "tau_y"),
    "opencv_fisheye": ("k1", "k2", "k3", "k4"),
    "omni": ("xi", "k1", "k2", "p1", "p2", "k3"),
    "double_sphere": ("xi", "alpha"),
    "scaramuzza": ("b1", "b2", "b3", "b4", "d", "e"),
}  # fmt: skip
"""Coefficients in the order of their program; the last six of ``opencv`` (thin prism and tilted
sensor) are names only: this package has none of them."""

MODELS = {
    "opencv": (
        "", "none", "pinhole", "perspective", "opencv", "fullopencv", "plumbbob", "radtan", "brown",
        "brownconrady", "radialtangential", "rational", "rationalpolynomial",
    ),
    "opencv_fisheye": (
        "fisheye", "equidistant", "equi", "opencvfisheye", "kannalabrandt", "kannalabrandt4",
        "kannalabrandt8", "kb4", "kb8",
    ),
    "omni": ("omni", "omnidir", "omniradtan", "mei", "unified"),
    "double_sphere": ("ds", "doublesphere"),
}  # fmt: skip
"""Names of each model, small and without anything but letters and digits."""


def plain(name: str) -> str:
    """Return a name by which programs that write it differently agree."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def lens_of(named: str, where: str) -> str:
    """Return this package's name of a lens model.

    Raises:
        InputError: it has none of this name.
    """
    for model, names in MODELS.items():
        if plain(named) in names or named == model:
            return model
    if named in CAMERAS:
        return named
    raise InputError(
        f"the camera model '{named}' is not known", where,
        f"calibrate with one of {', '.join(sorted(CAMERAS))}",
    )  # fmt: skip


def trimmed(model: str, coefficients: Sequence[float], where: str) -> list[float]:
    """Return the coefficients as the rig file takes them, without zeros beyond what it takes.

    Raises:
        InputError: one that this package does not have is not zero.
    """
    allowed = CAMERAS[model].max_coefficients
    used = max((i + 1 for i, c in enumerate(coefficients) if c != 0), default=0)
    if used > max(allowed):
        names = LENS_NAMES[model]
        name = names[used - 1] if used <= len(names) else f"coefficient {used}"
        raise InputError(
            f"{name} is {coefficients[used - 1]:g}, and the camera model {model} has no such term",
            where, "calibrate without it",
        )  # fmt: skip
    if len(coefficients) in allowed:
        return list(coefficients)
    count = min(n for n in allowed if n >= used)
    return [*coefficients, *[0.0] * max(0, count - len(coefficients))][:count]

"""What is read from a camera file, in the words of the rig file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ...errors import InputError
from .lenses import LENS_NAMES, lens_of, plain, trimmed

Values = dict[str, Any]


@dataclass(frozen=True)
class CameraFile:
    """A camera, and a projector where the file holds one."""

    camera: Values
    """Keys of the rig file's ``camera``; ``width`` and ``height`` may be missing."""
    named: str
    """How the file calls the model; empty if it does not."""
    projector: Values = field(default_factory=dict)
    """Keys of the rig file's ``projector``, ``width`` and ``height`` where the file has them."""

    def describe(self) -> str:
        """Return which model and numbers were read, in one sentence."""
        model, (fx, _, cx), (_, fy, cy) = self.camera["model"], *self.camera["K"][:2]
        names = LENS_NAMES[model]
        values = self.camera["distortion"]
        lens = ", ".join(f"{n} {v:g}" for n, v in zip(names, values, strict=False))
        told = f"as it says ({self.named})" if self.named else "the file names no model"
        return f"camera model {model}, {told}; fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}, " + (
            f"coefficients {lens}" if values else "no distortion"
        )


def camera_file(
    K: Sequence[Sequence[float]],
    coefficients: Sequence[float],
    size: tuple[int, int] | None,
    named: str,
    where: str,
    projector: Values | None = None,
) -> CameraFile:
    """Return the record of a camera.

    Args:
        K: (3, 3) camera matrix, pixels, integer pixel = pixel centre.
        coefficients: in the order of the model, with as many zeros at the end as the file has.
        size: width and height, pixels, if the file says them.
        named: the model as the file calls it; empty means Brown, as OpenCV's calibration writes it.
        where: file and part of it, for errors.
        projector: values of the rig file's projector.

    Raises:
        InputError: a model, or a coefficient that is not zero, which this package does not have.
    """
    model = lens_of(named, where)
    if plain(named) == "none" and any(coefficients):
        raise InputError("the model is 'none', and coefficients follow", where, "mend one of them")
    camera: Values = {
        "model": model,
        "K": [[float(v) for v in row] for row in K],
        "distortion": trimmed(model, [float(c) for c in coefficients], where),
    }
    if size is not None:
        camera["width"], camera["height"] = size
    return CameraFile(camera, named, projector or {})


def matrix(fx: float, fy: float, cx: float, cy: float) -> list[list[float]]:
    """Return the camera matrix of these numbers, pixels."""
    return [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]


def numbers(value: Any, where: str, count: int | None = None) -> list[float]:
    """Return nested lists of numbers in one row.

    Raises:
        InputError: it is none, or not so many.
    """
    flat: list[float] = []
    for item in value if isinstance(value, list | tuple) else [value]:
        if isinstance(item, list | tuple):
            flat += numbers(item, where)
        else:
            flat.append(_number(item, where))
    if count is not None and len(flat) != count:
        raise InputError(f"has {len(flat)} numbers, not {count}", where, "mend the value")
    return flat


def pixels(value: Any, where: str) -> tuple[int, int]:
    """Return two numbers of pixels.

    Raises:
        InputError: they are not two whole numbers.
    """
    first, second = numbers(value, where, 2)
    if not (first.is_integer() and second.is_integer()):
        raise InputError(f"is {first:g} x {second:g} pixels", where, "give whole numbers")
    return int(first), int(second)


def _number(value: Any, where: str) -> float:
    """Return a number; YAML 1.1 reads 1e-05, without a point, as text."""
    try:
        return float("" if isinstance(value, bool) else value)
    except (TypeError, ValueError):
        raise InputError(
            f"is not a list of numbers, got {value!r}", where, "mend the value"
        ) from None


def square(value: Any, where: str) -> list[list[float]]:
    """Return nine numbers as three rows.

    Raises:
        InputError: they are not nine.
    """
    flat = numbers(value, where, 9)
    return [flat[0:3], flat[3:6], flat[6:9]]

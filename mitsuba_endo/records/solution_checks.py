"""Whether a solution or truth that was read is one: what types alone do not say."""

from collections.abc import Iterator
from pathlib import PurePath
from typing import Any

import numpy as np

from ..errors import InputError, shown
from ..geometry.projection_models import PROJECTION_MODELS
from .rig import MAX_PROJECTOR_DISTORTION
from .solution import Estimate, PoseEstimate, Solution
from .validation import LARGEST

_ROTATION = 1e-3
"""How far R R' may be from the identity: single precision leaves 1e-6."""
_STD = ("std", "std_formal", "std_jackknife")


def check_solution(solution: Solution, source: str) -> Solution:
    """Return a solution whose lists have the right lengths and whose numbers can be used.

    Raises:
        InputError: names the source and the field.
    """
    for field, what in _faults(solution):
        raise InputError(what, f"{source}: {field}", "calibrate or render again")
    return solution


def _faults(solution: Solution) -> Iterator[tuple[str, str]]:
    """Yield fields and what is wrong with them."""
    projector, surface = solution.projector, solution.surface
    if projector.law not in PROJECTION_MODELS:
        yield "projector.law", f"unknown law {shown(projector.law)}"
    for name, count in (("focal", 0), ("aspect", 0), ("centre", 2), ("distortion", None)):
        yield from _estimate(f"projector.{name}", getattr(projector, name), count)
    for name in ("width", "height"):
        size = getattr(projector, name)
        if size is not None and not 0 < size <= 65_536:
            yield f"projector.{name}", f"is {shown(size)} pixels"
    if surface is not None and (PurePath(surface).name != surface or len(surface) > 200):
        yield "surface", f"{shown(surface)} is no name of a file"
    for k, frame in enumerate(solution.frames):
        yield from _pose(f"frames.{k}.projector_from_camera", frame.projector_from_camera)
        yield from _pose(f"frames.{k}.world_from_camera", frame.world_from_camera)
        if frame.focal is not None:
            yield from _estimate(f"frames.{k}.focal", frame.focal, 0)
    for k, other in enumerate(solution.alternatives):
        yield from _transform(f"alternatives.{k}", other.R, other.t)


def _estimate(field: str, estimate: Estimate, count: int | None) -> Iterator[tuple[str, str]]:
    """Look at a number (``count`` 0), a vector, or coefficients of any number (None)."""
    value = estimate.value
    if value is None:
        return
    length = len(value) if isinstance(value, list) else 0
    most = MAX_PROJECTOR_DISTORTION
    wrong = (length > most or not isinstance(value, list)) if count is None else length != count
    if wrong:
        yield field, f"has {length} numbers" if length else "is not of its kind"
        return
    if not (np.abs(np.array(value, float)) <= LARGEST).all():
        yield field, f"is {shown(value)}"
    if count == 0 and not float(value) > 0:  # pyright: ignore[reportArgumentType]
        yield field, f"is {shown(value)}, not above zero"
    yield from _stds(field, estimate, length)


def _pose(field: str, pose: PoseEstimate) -> Iterator[tuple[str, str]]:
    if (pose.R is None) != (pose.t is None):
        yield field, "has R or t alone"
    elif pose.R is not None:
        yield from _transform(field, pose.R, pose.t)
    yield from _stds(field, pose, 6)


def _transform(field: str, R: Any, t: Any) -> Iterator[tuple[str, str]]:
    rotation, shift = np.array(R, float), np.array(t, float)
    if not (np.abs(rotation) <= 2).all() or not _is_rotation(rotation):
        yield f"{field}.R", "is not a rotation matrix"
    if not (np.abs(shift) <= LARGEST).all():
        yield f"{field}.t", f"is {shown(t)}"


def _is_rotation(R: Any) -> bool:
    return bool(np.abs(R @ R.T - np.eye(3)).max() < _ROTATION and np.linalg.det(R) > 0)


def _stds(field: str, estimate: Estimate | PoseEstimate, length: int) -> Iterator[tuple[str, str]]:
    for name in _STD:
        std = getattr(estimate, name)
        if std is None:
            continue
        if (len(std) if isinstance(std, list) else 0) != length:
            yield f"{field}.{name}", "has another number of values than what it belongs to"
        elif not (np.array(std, float) >= 0).all():
            yield f"{field}.{name}", "is below zero"

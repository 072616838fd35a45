"""The values of a solution as rows of a table."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..records.solution import INTERVAL, Estimate, Frame, PoseEstimate, Solution


@dataclass(frozen=True)
class Row:
    """One number with its 95 % interval."""

    group: str
    """What it belongs to: the projector, or a frame by its name."""
    quantity: str
    value: str
    interval: str
    """Half width of the 95 % interval with its sign, empty where there is none."""
    unit: str
    status: str
    reason: str = ""
    """Why the value is weak or missing."""


def rows(solution: Solution) -> list[Row]:
    """List the projector's intrinsics and each frame's pose and residuals."""
    projector = solution.projector
    out = []
    for name, quantity, unit in (
        ("focal", "focal length", "pattern px"), ("centre", "centre", "pattern px"),
        ("aspect", "aspect", "fy/fx"), ("distortion", "distortion", ""),
    ):  # fmt: skip
        out += _estimate("Projector", quantity, getattr(projector, name), unit)
    for i, frame in enumerate(solution.frames):
        gives_scale = i == 0 and solution.scale in ("baseline", "up_to_scale")
        out += _frame(frame, solution.units, gives_scale)
    return out


def _frame(frame: Frame, units: str, gives_scale: bool) -> list[Row]:
    out = []
    if frame.focal is not None:
        out += _estimate(frame.name, "focal length", frame.focal, "pattern px")
    out += _pose(frame.name, "projector", frame.projector_from_camera, units)
    pose = frame.projector_from_camera.to_transform()
    if pose is not None:
        length = "mm" if units == "mm" else "baselines"
        status = "fixed" if gives_scale else frame.projector_from_camera.status
        value, half = _baseline(frame, gives_scale)
        out.append(Row(frame.name, "baseline", value, half, length, status))
    if frame.world_from_camera.status != "fixed":
        out += _pose(frame.name, "camera", frame.world_from_camera, units)
    if frame.rms_px is not None:
        used = "" if frame.used is None else f"{frame.used} pixels used"
        out.append(Row(frame.name, "residual, RMS", f"{frame.rms_px:.3g}", "", "pattern px", used))
    if frame.outliers is not None:
        out.append(Row(frame.name, "pixels not used", f"{100 * frame.outliers:.2g}", "", "%", ""))
    return out


def _baseline(frame: Frame, given: bool) -> tuple[str, str]:
    """Return the length of a frame's baseline and its interval, empty where it was given."""
    pose = frame.projector_from_camera
    length = float(np.linalg.norm(np.array(pose.t, float)))
    std = None if given else pose.length_std()
    return interval(length, std) if std else (f"{length:.5g}", "")


def _estimate(group: str, quantity: str, estimate: Estimate, unit: str) -> list[Row]:
    status, reason = estimate.status, estimate.reason or ""
    if not isinstance(estimate.value, list):
        std = estimate.std if isinstance(estimate.std, float) else None
        return [Row(group, quantity, *interval(estimate.value, std), unit, status, reason)]
    stds = estimate.std if isinstance(estimate.std, list) else [None] * len(estimate.value)
    parts = "xy" if quantity == "centre" else [str(i + 1) for i in range(len(estimate.value))]
    return [
        Row(group, f"{quantity} {part}", *interval(value, std), unit, status, reason)
        for part, value, std in zip(parts, estimate.value, stds, strict=True)
    ]


def _pose(group: str, of: str, pose: PoseEstimate, units: str) -> list[Row]:
    """List rotation vector in degrees, translation and, for the projector, the baseline."""
    status, reason = pose.status, pose.reason or ""
    length = "mm" if units == "mm" else "baselines"
    transform = pose.to_transform()
    if transform is None:
        return [Row(group, f"{of} pose", "not determined", "", "", status, reason)]
    std = pose.std or [None] * 6
    angles = np.degrees(Rotation.from_matrix(transform.R).as_rotvec()).tolist()
    degrees = [None if s is None else math.degrees(s) for s in std[:3]]
    out = [
        Row(group, f"{of} rotation {axis}", *interval(v, s), "deg", status, reason)
        for axis, v, s in zip("xyz", angles, degrees, strict=True)
    ]
    out += [
        Row(group, f"{of} translation {axis}", *interval(v, s), length, status, reason)
        for axis, v, s in zip("xyz", transform.t.tolist(), std[3:], strict=True)
    ]
    return out


def interval(value: float | None, std: float | None) -> tuple[str, str]:
    """Format a value and half its 95 % interval, rounded to two digits of the latter."""
    if value is None:
        return "not determined", ""
    if std is None or not std > 0:
        return f"{value:.6g}", ""
    half = INTERVAL * std
    decimals = max(0, 1 - math.floor(math.log10(half)))
    return f"{value:.{decimals}f}", f"± {half:.{decimals}f}"


def headline(solution: Solution) -> str:
    """Return outcome, focal length, first baseline and residual in one line."""
    parts = [solution.outcome.replace("_", " ")]
    focal = solution.frames[0].focal or solution.projector.focal
    parts.append(f"focal length {_quantity(focal.value, focal.std, focal.status, 'pattern px')}")
    pose = solution.frames[0].projector_from_camera.to_transform()
    if pose is None:
        parts.append("projector pose unknown")
    elif solution.units == "mm":
        given = " (given)" if solution.scale == "baseline" else ""
        value, half = _baseline(solution.frames[0], bool(given))
        parts.append(f"baseline {' '.join(filter(None, (value, half)))} mm{given}")
    else:
        parts.append("up to scale")
    rms = [f.rms_px for f in solution.frames if f.rms_px is not None]
    if rms:
        parts.append(f"residual {math.sqrt(np.mean(np.square(rms))):.3g} px RMS")
    return "; ".join(parts)


def unit_name(solution: Solution) -> str:
    """Return the unit of length as a label."""
    return "mm" if solution.units == "mm" else "baselines"


def _quantity(value: Any, std: Any, status: str, unit: str) -> str:
    if value is None:
        return f"unknown ({status})"
    if status == "fixed":
        return f"{value:.6g} {unit} (given)"
    doubt = "" if status == "measured" else f" ({status})"
    if isinstance(std, float | int) and std > 0:
        return f"{' '.join(interval(value, std))} {unit} (95 %){doubt}"
    return f"{value:.6g} {unit}{doubt}"

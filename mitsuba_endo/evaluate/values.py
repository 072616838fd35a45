"""Every value of a solution beside the true one: error, interval, and whether that holds it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.transforms import RigidTransform
from ..records.solution import INTERVAL, Estimate, PoseEstimate, Solution
from ..records.validation import Record
from .truths import Pair

_AXES = ("x", "y", "z")
_GIVEN = ("fixed",)
"""States of values that were input: they have no interval, and count for nothing."""


class ComparedValue(Record):
    """One number of a solution and the truth."""

    group: str
    """The device, or the frame by its name."""
    quantity: str
    unit: str
    found: float | None
    true: float | None
    error: float | None
    """Found minus true; of a rotation, an axis of the rotation from true to found."""
    std: float | None
    interval: float | None
    """Half width of the 95 % interval; null where the value was given or has none."""
    deviations: float | None
    """Error over standard deviation."""
    inside: bool | None
    """Whether the interval holds the truth."""
    status: str
    reason: str | None = None
    """Why a value is null or weak."""


@dataclass(frozen=True)
class _Number:
    group: str
    quantity: str
    unit: str
    status: str
    reason: str | None


def _compared(
    of: _Number, value: float | None, true: float | None, std: float | None,
    error: float | None = None,
) -> ComparedValue:  # fmt: skip
    if error is None and value is not None and true is not None:
        error = value - true
    has_std = std is not None and std > 0 and of.status not in _GIVEN and error is not None
    std = std if has_std else None
    half = None if std is None else INTERVAL * std
    return ComparedValue(
        group=of.group, quantity=of.quantity, unit=of.unit, found=value, true=true, error=error,
        std=std, interval=half, deviations=None if std is None or error is None else error / std,
        inside=None if half is None or error is None else abs(error) <= half,
        status=of.status, reason=of.reason,
    )  # fmt: skip


def compare_values(
    solution: Solution, truth: Solution, pairs: Sequence[Pair]
) -> list[ComparedValue]:
    """Return every value that both sides have, intrinsics first and then frame by frame.

    Lengths are compared in mm, or, where either side is up to scale, in multiples of the first
    baseline of each.

    Args:
        solution: what was found.
        truth: exact values, of all frames.
        pairs: frames of the solution and the true ones.
    """
    scaled = solution.units != "mm" or truth.units != "mm"
    unit = "baselines" if scaled else "mm"
    factors = [_factor(f.projector_from_camera) if scaled else 1.0 for f in pairs[0]]
    out = [*_projector(solution, truth), *_camera(solution, truth)]
    for k, pair in enumerate(pairs):
        if any(f.focal is not None for f in pair):
            out += _focal(solution, truth, pair)
        poses = [f.projector_from_camera for f in pair]
        gives_scale = k == 0 and (scaled or solution.scale == "baseline")
        out += _pose(pair[0].name, "projector", poses, factors, unit, gives_scale)
        if k:
            out += _camera_motion(pairs[0], pair, factors, unit)
    return out


def _factor(pose: PoseEstimate) -> float:
    """Return what makes a baseline one; 1 where it is not known."""
    length = 0.0 if pose.t is None else float(np.linalg.norm(pose.t))
    return 1 / length if length > 0 else 1.0


def _projector(solution: Solution, truth: Solution) -> Iterator[ComparedValue]:
    projector, true = solution.projector, truth.projector
    per_frame = any(f.focal is not None for s in (solution, truth) for f in s.frames)
    if not per_frame:
        yield from _estimates("projector", "focal length", "px", projector.focal, true.focal)
    yield from _estimates("projector", "centre", "px", projector.centre, true.centre)
    yield from _estimates("projector", "aspect", "", projector.aspect, true.aspect)
    yield from _estimates("projector", "distortion", "", projector.distortion, true.distortion)


def _focal(solution: Solution, truth: Solution, pair: Pair) -> Iterator[ComparedValue]:
    own = [f.focal or s.projector.focal for f, s in zip(pair, (solution, truth), strict=True)]
    yield from _estimates(pair[0].name, "focal length", "px", *own)


def _camera(solution: Solution, truth: Solution) -> Iterator[ComparedValue]:
    """Yield the camera's intrinsics where both sides have one of the same model."""
    if solution.camera is None or truth.camera is None:
        return
    camera, true = solution.camera.to_model(), truth.camera.to_model()
    if camera.model != true.model:
        return
    K = [(np.diag(c.K)[:2].tolist(), c.K[:2, 2].tolist()) for c in (camera, true)]
    lens = [[float(v) for v in c.distortion] for c in (camera, true)]
    for name, quantity, unit, value, exact in (
        ("camera_focal", "focal length", "px", K[0][0], K[1][0]),
        ("camera_centre", "centre", "px", K[0][1], K[1][1]),
        ("camera_distortion", "distortion", "", *lens),
    ):
        block = solution.blocks.get(name) or Estimate(value=value, status="fixed")
        yield from _estimates(
            "camera", quantity, unit, block, Estimate(value=exact, status="fixed")
        )


def _estimates(
    group: str, quantity: str, unit: str, estimate: Estimate, true: Estimate
) -> Iterator[ComparedValue]:
    values, exact, stds = (_listed(v) for v in (estimate.value, true.value, estimate.std))
    count = max(len(values), len(exact))
    lens = quantity == "distortion"
    for i in range(count):
        part = "" if count == 1 and not lens else f" {'xy'[i] if not lens and i < 2 else i + 1}"
        of = _Number(group, quantity + part, unit, estimate.status, estimate.reason)
        yield _compared(of, _at(values, i, lens), _at(exact, i, lens), _at(stds, i, False))


def _listed(value: float | list[float] | None) -> list[float | None]:
    return list(value) if isinstance(value, list) else [value]


def _at(values: list[float | None], index: int, padded: bool) -> float | None:
    """Return a value; coefficients that are not listed are zero."""
    return values[index] if index < len(values) else 0.0 if padded else None


def _pose(
    group: str,
    of: str,
    poses: Sequence[PoseEstimate],
    factors: Sequence[float],
    unit: str,
    gives_scale: bool = False,
) -> Iterator[ComparedValue]:
    """Yield rotation, translation and, of a projector, the baseline."""
    pose, true = poses[0].to_transform(), poses[1].to_transform()
    status, reason = poses[0].status, poses[0].reason
    if pose is None or true is None:
        why = reason if pose is None else "the true pose is not known"
        yield _compared(_Number(group, f"{of} pose", "", status, why), None, None, None)
        return
    std = np.array(poses[0].std or [np.nan] * 6)
    turned = np.degrees(Rotation.from_matrix(pose.R @ true.R.T).as_rotvec())
    angles = [np.degrees(Rotation.from_matrix(p.R).as_rotvec()) for p in (pose, true)]
    for i, axis in enumerate(_AXES):
        number = _Number(group, f"{of} rotation {axis}", "deg", status, reason)
        s = float(np.degrees(std[i]))
        yield _compared(
            number, float(angles[0][i]), float(angles[1][i]), _known(s), float(turned[i])
        )
    t = [p.t * f for p, f in zip((pose, true), factors, strict=True)]
    for i, axis in enumerate(_AXES):
        number = _Number(group, f"{of} translation {axis}", unit, status, reason)
        spread = _known(float(std[3 + i] * factors[0]))
        yield _compared(number, float(t[0][i]), float(t[1][i]), spread)
    if of == "projector":
        number = _Number(group, "baseline", unit, "fixed" if gives_scale else status, reason)
        spread = poses[0].length_std()
        spread = None if spread is None else spread * factors[0]
        lengths = [float(np.linalg.norm(v)) for v in t]
        yield _compared(number, lengths[0], lengths[1], spread)


def _known(std: float) -> float | None:
    return std if np.isfinite(std) else None


def _camera_motion(
    first: Pair, pair: Pair, factors: Sequence[float], unit: str
) -> Iterator[ComparedValue]:
    """Yield a camera's pose beside the true motion since the first frame, in the found world."""
    estimate = pair[0].world_from_camera
    if estimate.status in _GIVEN:
        return  # an input, or of a frame that shares no surface with the first
    start = first[0].world_from_camera.to_transform()
    true, placed = (f.world_from_camera.to_transform() for f in (first[1], pair[1]))
    exact = PoseEstimate(R=None, t=None, status="unobservable")
    if start is not None and true is not None and placed is not None:
        world = RigidTransform(start.R, start.t * factors[0] / factors[1])
        exact = PoseEstimate.of(world @ true.inverse() @ placed)
    yield from _pose(pair[0].name, "camera", (estimate, exact), factors, unit)

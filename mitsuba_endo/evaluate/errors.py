"""A solution against the truth, from records and folders to one record of metrics."""

from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import Frame, Solution
from ..records.surface import load_surface
from .metric_value import Metric, rms
from .metrics_file import FrameMetrics, Metrics
from .poses import (
    baseline_error,
    camera_errors,
    focal_error,
    rotation_error,
    translation_direction_error,
)
from .shape import Alignment, Lighting, ShapeErrors, compare_shape

Pair = tuple[Frame, Frame]
"""A frame of the solution and that of the truth."""

POSE_KEYS = (
    "focal_error_percent", "rotation_error_deg", "translation_direction_error_deg",
    "baseline_error_percent",
)  # fmt: skip


def evaluate(
    solution: Solution,
    truth: Solution,
    solution_dir: str | Path | None = None,
    truth_dir: str | Path | None = None,
    alignment: Alignment | None = None,
) -> Metrics:
    """Compare a solution with the truth.

    Args:
        solution: what was found.
        truth: the exact values, same structure.
        solution_dir: folder of the solution's surface file; None leaves the shape out.
        truth_dir: folder of the true surface file; None leaves the shape out.
        alignment: what to take out before comparing surfaces; default ``none`` if both are in mm,
            ``scale`` (about the first camera's centre) if the solution is up to scale.

    Raises:
        InputError: frames that cannot be paired, images of different sizes, or a named surface file
            that cannot be read.
    """
    pairs, matched_by = match_frames(solution, truth)
    no_unit = _without_unit(solution, truth)
    metrics = [_metrics_of(pairs[0], pair, solution, truth, no_unit) for pair in pairs]
    names = [frame.name for frame, _ in pairs]
    summary = {key: rms([f[key] for f in metrics], names) for key in POSE_KEYS}
    alignment = alignment or ("none" if solution.units == "mm" else "scale")
    shape = _shape(solution, truth, solution_dir, truth_dir, pairs[0], alignment)
    reasons = {key: metric.reason for key, metric in summary.items() if metric.reason}
    values: dict[str, Any] = {key: metric.value for key, metric in summary.items()}
    return Metrics(
        **values, **_shape_values(shape, alignment, reasons), matched_by=matched_by,
        frames=[_frame_metrics(pair, f) for pair, f in zip(pairs, metrics, strict=True)],
        reasons=reasons,
    )  # fmt: skip


def match_frames(
    solution: Solution, truth: Solution
) -> tuple[list[Pair], Literal["name", "order"]]:
    """Pair every frame of the solution with one of the truth.

    By name, else by name without suffix, else by order where there are equally many.

    Raises:
        InputError: neither way is possible, or the images are of different sizes.
    """
    sizes = [(c.width, c.height) for c in (solution.camera, truth.camera) if c is not None]
    if len(set(sizes)) > 1:
        here, there = ("{} x {}".format(*size) for size in sizes)
        raise InputError(
            f"images of {there} pixels, but the solution's are {here}", "truth: camera",
            "give the truth of the same capture",
        )  # fmt: skip
    for name in (lambda f: f.name, lambda f: Path(f.name).stem):
        there = {name(f): f for f in truth.frames}
        unique = len(there) == len(truth.frames)
        if unique and all(name(f) in there for f in solution.frames):
            return [(f, there[name(f)]) for f in solution.frames], "name"
    if len(solution.frames) != len(truth.frames):
        lost = next(f.name for f in solution.frames if f.name not in {t.name for t in truth.frames})
        raise InputError(
            f"no frame of this name in the truth, which has {len(truth.frames)} frames",
            f"solution: frame {lost}",
            "name the truth's frames as the maps",
        )
    return list(zip(solution.frames, truth.frames, strict=True)), "order"


def _without_unit(solution: Solution, truth: Solution) -> Metric | None:
    """Return an unknown metric with the reason where lengths cannot be compared, else None."""
    for side, record in (("solution", solution), ("truth", truth)):
        if record.units != "mm":
            return Metric.unknown(f"the {side} is up to scale")
    return None


def _metrics_of(
    first: Pair, pair: Pair, solution: Solution, truth: Solution, no_unit: Metric | None
) -> dict[str, Metric]:
    found, true = pair
    poses = found.projector_from_camera, true.projector_from_camera
    turned, moved = camera_errors(
        (first[0].world_from_camera, found.world_from_camera),
        (first[1].world_from_camera, true.world_from_camera),
    )
    return {
        "focal_error_percent": focal_error(
            found.focal or solution.projector.focal, true.focal or truth.projector.focal
        ),
        "rotation_error_deg": rotation_error(*poses),
        "translation_direction_error_deg": translation_direction_error(*poses),
        "baseline_error_percent": no_unit or baseline_error(*poses),
        "camera_rotation_error_deg": turned,
        "camera_translation_error_mm": no_unit or moved,
    }


def _frame_metrics(pair: Pair, metrics: dict[str, Metric]) -> FrameMetrics:
    values: dict[str, Any] = {key: metric.value for key, metric in metrics.items()}
    return FrameMetrics(name=pair[0].name, truth=pair[1].name, **values)


def _shape(
    solution: Solution,
    truth: Solution,
    solution_dir: str | Path | None,
    truth_dir: str | Path | None,
    first: Pair,
    alignment: Alignment,
) -> ShapeErrors | str:
    """Return the shape errors or why there are none."""
    sides = (("solution", solution, solution_dir), ("truth", truth, truth_dir))
    surfaces = []
    for side, record, folder in sides:
        if record.surface is None:
            return f"the {side} has no surface"
        if folder is None:
            return f"the folder of the {side}'s surface is not given"
        surfaces.append(Path(folder) / record.surface)
    camera = truth.camera or solution.camera
    if camera is None:
        return "neither side has camera intrinsics"
    if truth.units != "mm":
        return "the truth is up to scale"
    if solution.units != "mm" and alignment in ("none", "rigid"):
        return f"the solution is up to scale, which alignment '{alignment}' leaves as it is"
    frame_from_truth = first_from_truth(truth, first[1])
    if frame_from_truth is None:
        return "the true camera pose of the solution's first frame is null"
    found, true = (load_surface(path) for path in surfaces)
    true = SurfaceEstimate(frame_from_truth.apply(true.vertices), true.faces)
    return compare_shape(found, true, camera.to_model(), _lighting(truth, first[1]), alignment)


def first_from_truth(truth: Solution, frame: Frame) -> RigidTransform | None:
    """Return the motion from the truth's first camera to that of ``frame``.

    The true surface is given in the truth's first camera, which the solution may have left out.
    """
    if frame is truth.frames[0]:
        return RigidTransform.identity()
    first = truth.frames[0].world_from_camera.to_transform()
    other = frame.world_from_camera.to_transform()
    return None if first is None or other is None else other.inverse() @ first


def _lighting(truth: Solution, frame: Frame) -> Lighting | None:
    projector = truth.projector
    if frame.focal is not None:
        projector = projector.model_copy(update={"focal": frame.focal})
    model, pose = projector.to_model(), frame.projector_from_camera.to_transform()
    if model is None or pose is None or not (projector.width and projector.height):
        return None
    return Lighting(model, (projector.width, projector.height), pose)


def _shape_values(
    shape: ShapeErrors | str, alignment: Alignment, reasons: dict[str, str]
) -> dict[str, Any]:
    """Return the shape keys of :class:`Metrics`, adding to ``reasons`` those that are null."""
    keys = ("shape_rmse_mm", "shape_median_mm", "shape_ray_rmse_mm", "coverage")
    if isinstance(shape, str):
        reasons.update(dict.fromkeys(keys, shape))
        return {**dict.fromkeys(keys), "alignment": None}
    values = dict(
        zip(keys, (shape.rmse, shape.median, shape.ray_rmse, shape.coverage), strict=True)
    )
    if shape.ray_rmse is None:
        reasons["shape_ray_rmse_mm"] = "no camera ray meets both surfaces"
    if shape.coverage is None:
        reasons["coverage"] = "no true surface is both seen and lit"
    return {**values, "alignment": alignment, "alignment_scale": shape.alignment_scale}

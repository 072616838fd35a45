"""A solution against the truth, from records and folders to one record of metrics."""

from pathlib import Path
from typing import Any

from ..records.solution import Outcome, Solution
from .matching import MatchBy
from .metric_value import Metric, rms
from .metrics_file import FrameMetrics, Metrics
from .poses import (
    baseline_error,
    camera_errors,
    focal_error,
    rotation_error,
    translation_direction_error,
)
from .shape import Alignment, ShapeErrors
from .surfaces import surface_errors
from .truths import Pair, Truths, truths_of
from .values import compare_values

POSE_KEYS = (
    "focal_error_percent", "rotation_error_deg", "translation_direction_error_deg",
    "baseline_error_percent",
)  # fmt: skip


def evaluate(
    solution: Solution,
    truth: Solution | Truths,
    solution_dir: str | Path | None = None,
    truth_dir: str | Path | None = None,
    alignment: Alignment | None = None,
    match: MatchBy = "name",
) -> Metrics:
    """Compare a solution with the truth.

    Args:
        solution: what was found.
        truth: the exact values, same structure; or of several captures, with their surfaces.
        solution_dir: folder of the solution's surface files; None leaves the shape out.
        truth_dir: folder of the true surface file of a ``Solution``; None leaves the shape out.
        alignment: what to take out before comparing surfaces; default ``none`` if both are in mm,
            ``scale`` (about the first camera's centre) if the solution is up to scale.
        match: how frames are paired.

    Raises:
        InputError: frames that cannot be paired, images of different sizes, or a named surface file
            that cannot be read.
    """
    truths = truth if isinstance(truth, Truths) else truths_of(truth, truth_dir)
    chosen, matched_by = truths.match(solution, match)
    exact = truths.record
    pairs = [(f, exact.frames[j]) for f, j in zip(solution.frames, chosen, strict=True)]
    no_unit = _without_unit(solution, exact)
    metrics = [_metrics_of(pairs[0], pair, solution, exact, no_unit) for pair in pairs]
    names = [frame.name for frame, _ in pairs]
    summary = {key: rms([f[key] for f in metrics], names) for key in POSE_KEYS}
    alignment = alignment or ("none" if solution.units == "mm" else "scale")
    shapes = surface_errors(solution, truths, chosen, solution_dir, alignment)
    reasons = {key: metric.reason for key, metric in summary.items() if metric.reason}
    values: dict[str, Any] = {key: metric.value for key, metric in summary.items()}
    return Metrics(
        **values, **_shape_values(shapes[0], alignment, reasons), matched_by=matched_by,
        frames=[
            _frame_metrics(pair, f, shape)
            for pair, f, shape in zip(pairs, metrics, shapes, strict=True)
        ],
        values=compare_values(solution, exact, pairs), reasons=reasons,
    )  # fmt: skip


def _without_unit(solution: Solution, truth: Solution) -> Metric | None:
    """Return an unknown metric with the reason where lengths cannot be compared, else None."""
    for side, record in (("solution", solution), ("truth", truth)):
        if record.units != "mm":
            return Metric.unknown(f"the {side} is up to scale")
    return None


def is_truth(solution: Solution) -> bool:
    """Tell exact values, and those of files without deviations, from a calibration's."""
    return solution.outcome is Outcome.TRUTH


def _metrics_of(
    first: Pair, pair: Pair, solution: Solution, truth: Solution, no_unit: Metric | None
) -> dict[str, Metric]:
    frame, true = pair
    poses = frame.projector_from_camera, true.projector_from_camera
    turned, moved = camera_errors(
        (first[0].world_from_camera, frame.world_from_camera),
        (first[1].world_from_camera, true.world_from_camera),
    )
    if pair is not first and frame.world_from_camera.status == "fixed" and not is_truth(solution):
        turned = moved = Metric.unknown("the camera's pose is no unknown")
    return {
        "focal_error_percent": focal_error(
            frame.focal or solution.projector.focal, true.focal or truth.projector.focal
        ),
        "rotation_error_deg": rotation_error(*poses),
        "translation_direction_error_deg": translation_direction_error(*poses),
        "baseline_error_percent": no_unit or baseline_error(*poses),
        "camera_rotation_error_deg": turned,
        "camera_translation_error_mm": no_unit or moved,
    }


def _frame_metrics(
    pair: Pair, metrics: dict[str, Metric], shape: ShapeErrors | str
) -> FrameMetrics:
    values: dict[str, Any] = {key: metric.value for key, metric in metrics.items()}
    if not isinstance(shape, str):
        values |= {"shape_rmse_mm": shape.rmse, "shape_median_mm": shape.median}
    return FrameMetrics(name=pair[0].name, truth=pair[1].name, **values)


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

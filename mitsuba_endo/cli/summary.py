"""Tables of results for a human reader."""

from typing import TYPE_CHECKING

import numpy as np

from ..records.solution import INTERVAL

if TYPE_CHECKING:
    from rich.table import Table

    from ..evaluate.sequence_metrics import SequenceMetrics
    from ..evaluate.table import ErrorTable
    from ..records.solution import Estimate, PoseEstimate, Solution


SEQUENCE_METRICS = {
    "frames": ("frames", ""),
    "lost": ("frames lost", ""),
    "other_parts": ("frames in other parts", ""),
    "ate_aligned_rms_mm": ("absolute trajectory error, aligned, RMS", "mm"),
    "ate_aligned_max_mm": ("the same, largest", "mm"),
    "ate_first_rms_mm": ("the same, first cameras put together, RMS", "mm"),
    "rpe_shift_rms_mm": ("motions over 10 frames, RMS", "mm"),
    "rpe_turn_rms_deg": ("turns over 10 frames, RMS", "deg"),
    "last_to_first_mm": ("last frame against the first", "mm"),
    "scale_error_percent": ("scale of the way", "%"),
    "scale_worst_percent": ("the same, worst of 100 frames in a row", "%"),
    "focal_error_percent": ("focal length", "%"),
    "surface_rms_mm": ("surface distance, aligned, RMS", "mm"),
    "surface_median_mm": ("surface distance, aligned, median", "mm"),
    "surface_first_rms_mm": ("the same, first cameras put together, RMS", "mm"),
    "completeness_percent": ("seen surface found within 1 mm", "%"),
    "camera_intervals_percent": ("95 % intervals of camera poses that hold the truth", "%"),
    "projector_intervals_percent": ("95 % intervals of projector poses that do", "%"),
    "vertex_intervals_percent": ("95 % intervals of vertices that do", "%"),
}
"""What of :class:`SequenceMetrics` is shown, with the unit."""
INTERVAL_COLUMN = "± (95 %)"
_ROUNDING = 1e-12
"""A value below, in whatever unit, is a rounding error of double precision and shown as 0."""


def solution_table(solution: "Solution") -> "Table":
    """List the unknowns with their units; poses axis by axis for one frame, else a row a frame."""
    from rich.text import Text

    table = _table("Calibration", "Quantity", "Value", INTERVAL_COLUMN, "Unit", "Status")
    projector = solution.projector
    for name, unit in (
        ("focal", "pattern px"), ("centre", "pattern px"), ("aspect", "fy/fx"), ("distortion", ""),
    ):  # fmt: skip
        _estimate_rows(table, name, getattr(projector, name), unit)
    for i, frame in enumerate(solution.frames):
        table.add_section()
        table.add_row(Text(frame.name, style="bold"), "", "", "", "")
        if frame.focal is not None:
            _estimate_rows(table, "focal", frame.focal, "pattern px")
        pose = frame.projector_from_camera
        _pose_rows(table, pose, solution.units, len(solution.frames) > 1)
        transform = pose.to_transform()
        if transform is not None:
            given = i == 0 and solution.scale in ("baseline", "up_to_scale")
            status = "fixed" if given else pose.status
            length = f"{np.linalg.norm(transform.t):.5g}"
            half = "" if given else _half(pose.length_std())
            table.add_row("baseline", length, half, solution.units, status)
        if frame.rms_px is not None:
            used = "" if frame.used is None else f"{frame.used} pixels"
            table.add_row("residual RMS", f"{frame.rms_px:.3f}", "", "pattern px", used)
    for left in solution.left_out:
        table.add_section()
        table.add_row(Text(left.name, style="bold"), "left out", "", "", "")
    return table


def _estimate_rows(table: "Table", name: str, estimate: "Estimate", unit: str) -> None:
    if not isinstance(estimate.value, list):
        table.add_row(name, numbers(estimate.value), _half(estimate.std), unit, estimate.status)
        return
    stds = estimate.std if isinstance(estimate.std, list) else [None] * len(estimate.value)
    parts = "xy" if name == "centre" else [str(i + 1) for i in range(len(estimate.value))]
    for part, value, std in zip(parts, estimate.value, stds, strict=True):
        table.add_row(f"{name} {part}", numbers(value), _half(std), unit, estimate.status)


def _pose_rows(table: "Table", pose: "PoseEstimate", unit: str, short: bool) -> None:
    transform = pose.to_transform()
    if transform is None:
        table.add_row("projector pose", "-", "", "", pose.status)
        return
    if not short:
        std = pose.std or [None] * 6
        degrees = [None if s is None else float(np.degrees(s)) for s in std[:3]]
        for axis, value, s in zip("xyz", _rotation_degrees(transform.R), degrees, strict=True):
            name = f"projector rotation {axis}"
            table.add_row(name, numbers(value, 5), _half(s), "deg", pose.status)
        for axis, value, s in zip("xyz", transform.t.tolist(), std[3:], strict=True):
            name = f"projector translation {axis}"
            table.add_row(name, numbers(value, 5), _half(s), unit, pose.status)


def _rotation_degrees(R: np.ndarray) -> list[float]:
    from scipy.spatial.transform import Rotation

    return np.degrees(Rotation.from_matrix(R).as_rotvec()).tolist()


def _half(std: float | list[float] | None) -> str:
    """Format half of a number's 95 % interval."""
    return numbers(INTERVAL * std if isinstance(std, float) else None, 2)


def numbers(value: float | list[float] | None, digits: int = 6) -> str:
    """Format a number or a list; ``-`` for what is not known, 0 for what is only rounding."""
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(numbers(v, digits) for v in value)
    return "0" if abs(value) < _ROUNDING else f"{value:.{digits}g}"


def _table(title: str, *columns: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for i, column in enumerate(columns):
        table.add_column(column, overflow="fold", no_wrap=i == 0)
    return table


def comparison_table(solution: "Solution", truth: "Solution") -> "Table":
    """Set what was found beside the truth, for the first frame."""
    table = _table(
        "Projector, found and true", "Quantity", "Found", INTERVAL_COLUMN, "True", "Unit"
    )
    focal, true_focal = solution.projector.focal, truth.projector.focal
    table.add_row(
        "focal length", numbers(focal.value), _half(focal.std), numbers(true_focal.value),
        "pattern px",
    )  # fmt: skip
    estimate = solution.frames[0].projector_from_camera
    pose, true = (s.frames[0].projector_from_camera.to_transform() for s in (solution, truth))
    if pose is None or true is None:
        return table
    std = estimate.std or [None] * 6
    degrees = [None if s is None else float(np.degrees(s)) for s in std[:3]]
    angles = zip("xyz", _rotation_degrees(pose.R), degrees, _rotation_degrees(true.R), strict=True)
    for axis, value, s, is_true in angles:
        row = numbers(value, 4), _half(s), numbers(is_true, 4), "deg"
        table.add_row(f"rotation {axis}", *row)
    lengths = zip("xyz", pose.t.tolist(), std[3:], true.t.tolist(), strict=True)
    for axis, value, s, is_true in lengths:
        row = numbers(value, 4), _half(s), numbers(is_true, 4), solution.units
        table.add_row(f"translation {axis}", *row)
    return table


def sequence_table(metrics: "SequenceMetrics") -> "Table":
    """List a sequence's errors against the truth."""
    table = _table("Errors against the truth", "Quantity", "Value", "Unit")
    for key, (name, unit) in SEQUENCE_METRICS.items():
        table.add_row(name, numbers(getattr(metrics, key), 4), unit)
    return table


def error_table(errors: "ErrorTable") -> "Table":
    """Return a table of an evaluation, its note below it."""
    table = _table(errors.title, *errors.columns)
    table.caption, table.caption_justify = errors.note or None, "left"
    for row in errors.rows:
        if row[0] and errors.columns[0] == "" and table.row_count:
            table.add_section()
        table.add_row(*row)
    return table

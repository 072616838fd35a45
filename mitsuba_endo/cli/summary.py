"""Tables of results for a human reader."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rich.table import Table

    from ..evaluate.metrics import Metrics
    from ..records.solution import Estimate, PoseEstimate, Solution


METRICS = {
    "focal_error_percent": ("focal length", "%"),
    "rotation_error_deg": ("projector rotation", "deg"),
    "translation_direction_error_deg": ("projector translation direction", "deg"),
    "baseline_error_percent": ("baseline", "%"),
    "shape_rmse_mm": ("surface distance, RMS", "mm"),
    "shape_median_mm": ("surface distance, median", "mm"),
    "shape_ray_rmse_mm": ("range along camera rays, RMS", "mm"),
    "coverage": ("true surface covered", "of 1"),
}
"""What of :class:`Metrics` is shown, with the unit."""


_ROUNDING = 1e-12


def solution_table(solution: "Solution") -> "Table":
    """List every unknown of the projector and every frame's baseline and residual, with units."""
    table = _table("Calibration", "Quantity", "Value", "Std", "Unit", "Status")
    projector = solution.projector
    for name, unit in (
        ("focal", "pattern px"), ("centre", "pattern px"), ("aspect", "fy/fx"), ("distortion", ""),
    ):  # fmt: skip
        _estimate_row(table, f"projector {name}", getattr(projector, name), unit)
    for frame in solution.frames:
        if frame.focal is not None:
            _estimate_row(table, f"{frame.name}: focal", frame.focal, "pattern px")
        _pose_rows(table, frame.name, frame.projector_from_camera, solution.units)
        if frame.rms_px is not None:
            used = "" if frame.used is None else f"{frame.used} correspondences"
            rms = f"{frame.rms_px:.3f}"
            table.add_row(f"{frame.name}: residual RMS", rms, "", "pattern px", used)
    for left in solution.left_out:
        table.add_row(f"{left.name}", "left out", "", "", left.reason)
    return table


def _estimate_row(table: "Table", name: str, estimate: "Estimate", unit: str) -> None:
    if estimate.value == []:
        return
    status = estimate.status + (f": {estimate.reason}" if estimate.reason else "")
    table.add_row(name, numbers(estimate.value), numbers(estimate.std, 2), unit, status)


def _pose_rows(table: "Table", frame: str, pose: "PoseEstimate", unit: str) -> None:
    transform = pose.to_transform()
    status = pose.status + (f": {pose.reason}" if pose.reason else "")
    if transform is None:
        table.add_row(f"{frame}: projector pose", "-", "", "", status)
        return
    std = pose.std or [None] * 6
    rotation = [None if s is None else float(np.degrees(s)) for s in std[:3]]
    vector = np.degrees(_rotation_vector(transform.R)).tolist()
    table.add_row(f"{frame}: projector rotation", numbers(vector), _listed(rotation), "deg", status)
    t = transform.t.tolist()
    table.add_row(f"{frame}: projector translation", numbers(t), _listed(std[3:]), unit, status)
    table.add_row(f"{frame}: baseline", f"{np.linalg.norm(transform.t):.4g}", "", unit, "")


def _rotation_vector(R: np.ndarray) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_rotvec()


def numbers(value: float | list[float] | None, digits: int = 6) -> str:
    """Format a number or a list; ``-`` for what is not known, 0 for what is only rounding."""
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(numbers(v, digits) for v in value)
    return "0" if abs(value) < _ROUNDING else f"{value:.{digits}g}"


def _listed(values: list[float] | list[None] | list[float | None]) -> str:
    known = [v for v in values if v is not None]
    return numbers(known, 2) if len(known) == len(values) else "-"


def _table(title: str, *columns: str) -> "Table":
    from rich.table import Table

    table = Table(title=title)
    for i, column in enumerate(columns):
        table.add_column(column, overflow="fold", no_wrap=i == 0)
    return table


def comparison_table(solution: "Solution", truth: "Solution") -> "Table":
    """Set what was found beside the truth, for the first frame."""
    table = _table("Projector, found and true", "Quantity", "Found", "Std", "True", "Unit")
    focal, true_focal = solution.projector.focal, truth.projector.focal
    table.add_row(
        "focal length", numbers(focal.value), numbers(focal.std, 2),
        numbers(true_focal.value), "pattern px",
    )  # fmt: skip
    found, true = (s.frames[0].projector_from_camera for s in (solution, truth))
    poses = found.to_transform(), true.to_transform()
    std = found.std or [None] * 6
    if poses[0] is not None and poses[1] is not None:
        R, R_true = (np.degrees(_rotation_vector(pose.R)).tolist() for pose in poses if pose)
        degrees = [None if s is None else float(np.degrees(s)) for s in std[:3]]
        row = numbers(R, 4), _listed(degrees), numbers(R_true, 4), "deg"
        table.add_row("rotation vector", *row)
        t, t_true = (pose.t.tolist() for pose in poses if pose)
        row = numbers(t, 4), _listed(std[3:]), numbers(t_true, 4), solution.units
        table.add_row("translation", *row)
    return table


def metrics_table(metrics: "Metrics") -> "Table":
    """List the errors against the truth, or why there is none."""
    table = _table("Errors against the truth", "Quantity", "Error", "Unit", "Note")
    for key, (name, unit) in METRICS.items():
        value: float | None = getattr(metrics, key)
        table.add_row(name, numbers(value, 4), unit, metrics.reasons.get(key, ""))
    return table

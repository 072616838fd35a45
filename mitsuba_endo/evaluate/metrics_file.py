"""The figures of an evaluation, ``metrics.json``."""

from pathlib import Path
from typing import Any

from ..files import atomic_path
from ..records.validation import Record
from .matching import Matched
from .shape import Alignment
from .table import ErrorTable
from .values import ComparedValue

SHOWN = {
    "focal_error_percent": ("focal length", "%"),
    "rotation_error_deg": ("projector rotation", "deg"),
    "translation_direction_error_deg": ("projector translation direction", "deg"),
    "baseline_error_percent": ("baseline", "%"),
    "shape_rmse_mm": ("surface distance, RMS", "mm"),
    "shape_median_mm": ("surface distance, median", "mm"),
    "shape_ray_rmse_mm": ("range along camera rays, RMS", "mm"),
    "coverage": ("true surface covered", "of 1"),
}
"""What of :class:`Metrics` is shown first, with the unit."""
_ROUNDING = 1e-12
"""A value below, in whatever unit, is a rounding error of double precision and shown as 0."""


class FrameMetrics(Record):
    """Errors of one frame; a null has the same reason as its namesake in :class:`Metrics`."""

    name: str
    truth: str
    """Name of the frame of the truth it is compared with."""
    focal_error_percent: float | None
    """100 (f / f_truth - 1), signed."""
    rotation_error_deg: float | None
    """Angle between the two rotations of projector_from_camera."""
    translation_direction_error_deg: float | None
    """Angle between the two translations of projector_from_camera."""
    baseline_error_percent: float | None
    """100 (|t| / |t_truth| - 1), signed."""
    camera_rotation_error_deg: float | None
    """Angle between the two rotations of the camera since the first frame."""
    camera_translation_error_mm: float | None
    """Distance between the two translations of the camera since the first frame."""
    shape_rmse_mm: float | None = None
    """Of the frame's own surface; null where it shares that of the first."""
    shape_median_mm: float | None = None


class Metrics(Record):
    """Errors of a solution against the truth; null where either side is null.

    Errors of focal length and poses are root mean squares over the frames, so never negative; the
    signed values are in ``frames``. Shape errors are distances between surfaces in the first
    frame of the solution.
    """

    focal_error_percent: float | None
    rotation_error_deg: float | None
    translation_direction_error_deg: float | None
    baseline_error_percent: float | None
    shape_rmse_mm: float | None
    """Root mean square distance of the solution's vertices to the nearest true surface point."""
    shape_median_mm: float | None
    """Median of the same distances."""
    shape_ray_rmse_mm: float | None
    """Root mean square difference of range along the first camera's rays that meet both."""
    coverage: float | None
    """Share of the pixels of the first camera that see true surface lit by the pattern, in which
    the solution has a surface too."""
    alignment: Alignment | None
    """What was taken out of the surface before comparing shapes."""
    alignment_scale: float | None = None
    """What the solution's surface was multiplied by in the alignment."""
    matched_by: Matched
    """How frames were paired with those of the truth; ``only``: one each, by other names."""
    frames: list[FrameMetrics]
    values: list[ComparedValue] = []
    """Every number of the solution with its interval, and whether that holds the truth."""
    reasons: dict[str, str] = {}
    """Why a key is null, or covers fewer frames than there are."""

    def tables(self) -> list[ErrorTable]:
        """Return the summary, and every value with its interval."""
        return [_summary_table(self), _value_table(self)]

    def summary(self) -> dict[str, Any]:
        """Return everything, for programs."""
        return self.model_dump(mode="json")

    def save(self, path: str | Path) -> None:
        """Write ``metrics.json``."""
        with atomic_path(path) as aside:
            aside.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")


def _summary_table(metrics: Metrics) -> ErrorTable:
    rows = [
        (name, number(getattr(metrics, key)), unit, metrics.reasons.get(key, ""))
        for key, (name, unit) in SHOWN.items()
    ]
    how = {
        "name": "", "order": "Frames were matched by their order, as asked for.",
        "only": "The only frame is called otherwise in the truth.",
    }  # fmt: skip
    note = how[metrics.matched_by]
    return ErrorTable("Errors against the truth", ("Quantity", "Error", "Unit", "Note"), rows, note)


def _value_table(metrics: Metrics) -> ErrorTable:
    """List what was estimated, and what was given and is not as the truth says."""
    listed = [v for v in metrics.values if v.interval is not None or v.error != 0]
    rows, group = [], None
    for value in listed:
        rows.append(("" if value.group == group else value.group, *_cells(value)))
        group = value.group
    judged = [v for v in metrics.values if v.inside is not None]
    note = ""
    if judged:
        held = sum(bool(v.inside) for v in judged)
        note = f"{held} of {len(judged)} intervals (95 %) hold the truth."
    columns = ("", "Quantity", "Error", "± (95 %)", "Error / σ", "Inside", "Unit")
    return ErrorTable("Every value", columns, rows, note)


def _cells(value: ComparedValue) -> tuple[str, ...]:
    inside = "" if value.inside is None else "yes" if value.inside else "no"
    if value.inside is None and value.status == "fixed":
        inside = "given"
    error = number(value.error) if value.error is not None else value.reason or "-"
    half = number(value.interval, 2) if value.interval is not None else ""
    deviations = "" if value.deviations is None else f"{value.deviations:+.1f}"
    return value.quantity, error, half, deviations, inside, value.unit


def number(value: float | None, digits: int = 3) -> str:
    """Format an error; ``-`` for what is not known, 0 for what is only rounding."""
    if value is None:
        return "-"
    return "0" if abs(value) < _ROUNDING else f"{value:.{digits}g}"

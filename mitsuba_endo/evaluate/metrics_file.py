"""The figures of an evaluation, ``metrics.json``."""

from pathlib import Path
from typing import Literal

from ..files import atomic_path
from ..records.validation import Record
from .shape import Alignment


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
    matched_by: Literal["name", "order"]
    """How frames were paired with those of the truth."""
    frames: list[FrameMetrics]
    reasons: dict[str, str] = {}
    """Why a key is null, or covers fewer frames than there are."""

    def save(self, path: str | Path) -> None:
        """Write ``metrics.json``."""
        with atomic_path(path) as aside:
            aside.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")

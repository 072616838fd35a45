"""The figures of a sequence's evaluation, ``metrics.json``."""

from pathlib import Path

from ..files import atomic_path
from ..records.validation import Record


class FrameDepth(Record):
    """How one frame's depth differs from the true one, where its pattern lights the surface."""

    name: str
    median_mm: float | None
    """Median of the differences of z, in the frame's own camera; null where nothing is known."""
    covered_percent: float
    """Share of the lit pixels where a surface was found."""


class SequenceMetrics(Record):
    """Errors of a tracked sequence; null without a surface, or without a unit of length."""

    frames: int
    lost: int
    other_parts: int
    """Frames placed in parts that are not compared: only the one with the most frames is."""
    ate_aligned_rms_mm: float
    """Absolute trajectory error: distance of the cameras' centres after the alignment that makes
    it smallest, rigid, or with a scale where the result is up to scale."""
    ate_aligned_max_mm: float
    ate_first_rms_mm: float | None
    """The same with the first cameras put together instead."""
    rpe_shift_rms_mm: float
    """Relative pose error: of the motions over ten frames."""
    rpe_turn_rms_deg: float
    last_to_first_mm: float
    """The same of the motion from the first frame to the last: how well a loop closes."""
    scale_error_percent: float | None
    """100 (length of the way / its true length - 1), from the best similarity; signed."""
    scale_worst_percent: float | None
    """The same of those :data:`.tracked_frames.WINDOW` frames in a row that have the largest."""
    focal_error_percent: float | None
    surface_rms_mm: float | None
    """Distance of the found surface's vertices from the true one, aligned by the cameras' poses,
    rotations included: centres on a straight way leave the rotation about it open."""
    surface_median_mm: float | None
    surface_first_rms_mm: float | None
    """The same as ``surface_rms_mm`` with the first cameras put together instead."""
    vertex_intervals_percent: float | None
    """Share of the 95 % intervals of the surface's vertices, along their normals, that hold the
    true surface, the first cameras put together."""
    completeness_percent: float | None
    """Share of the true surface that frames saw lit with the found one within 1 mm."""
    camera_intervals_percent: float | None
    """Share of the 95 % intervals of cameras' poses that hold the truth, each component counted."""
    projector_intervals_percent: float | None
    depth: list[FrameDepth]
    """Of some frames, spread over the sequence."""

    def save(self, path: str | Path) -> None:
        """Write ``metrics.json``."""
        with atomic_path(path) as aside:
            aside.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")

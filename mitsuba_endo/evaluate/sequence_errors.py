"""A tracked sequence against the truth of every frame."""

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import Solution
from ..records.trajectory import FrameRow
from .metric_value import root_mean_square
from .poses import focal_error
from .sequence_metrics import SequenceMetrics
from .sequence_surface import TrackedViews
from .tracked_frames import PosePairs, TrackedFrames
from .trajectory_errors import absolute_trajectory_error, trajectory_alignment

SCALE_ERRORS = ("scale_error_percent", "scale_worst_percent")
"""Nothing where the scale is not known."""


def evaluate_sequence(
    tracked: TrackedFrames, truth: Solution, true_surface: SurfaceEstimate | None
) -> SequenceMetrics:
    """Compare poses, surface and intervals with the truth.

    Frames are paired by their names without suffix. Errors that no alignment takes out are in the
    world of the first placed camera. Where the sequence is up to scale, the scale is taken out of
    all lengths with the alignment.

    Args:
        tracked: of a sequence.
        truth: exact poses of its frames; the world is the first frame's camera, mm.
        true_surface: in this world; None leaves the surface out.

    Raises:
        InputError: fewer than three frames of the truth were placed, or a frame is not in it.
    """
    rows = tracked.placed
    true = _true_poses(rows, truth)
    if len(rows) < 3:
        raise InputError(
            f"{len(rows)} frames with a pose", "result", "at least three are needed to align them"
        )
    ours = PosePairs(rows, true)
    in_mm = tracked.solution.units == "mm"
    by = trajectory_alignment(ours.found, ours.true, "rigid" if in_mm else "similarity")
    aligned = absolute_trajectory_error(ours.found, ours.true, by)
    views = TrackedViews(tracked, ours, truth, true_surface)
    lost = sum(bool(row.lost) for row in tracked.rows)
    focal = focal_error(tracked.solution.projector.focal, truth.projector.focal)
    return SequenceMetrics(
        frames=len(tracked.rows),
        lost=lost,
        other_parts=len(tracked.rows) - lost - len(rows),
        ate_aligned_rms_mm=root_mean_square(aligned),
        ate_aligned_max_mm=float(aligned.max()),
        ate_first_rms_mm=ours.first_error() if in_mm else None,
        **ours.motions(by.scale),
        **(ours.scale_errors() if in_mm else dict.fromkeys(SCALE_ERRORS)),
        focal_error_percent=focal.value,
        camera_intervals_percent=ours.held("camera") if in_mm else None,
        projector_intervals_percent=ours.held("projector") if in_mm else None,
        **views.surface(),
        depth=views.depth(),
    )  # fmt: skip


def _true_poses(
    rows: Sequence[FrameRow], truth: Solution
) -> list[tuple[RigidTransform, RigidTransform]]:
    """Return world_from_camera and projector_from_camera of each row's frame in the truth.

    Raises:
        InputError: the truth has no such frame, or not its poses.
    """
    there = {Path(frame.name).stem: frame for frame in truth.frames}
    out = []
    for row in rows:
        frame = there.get(Path(row.name).stem)
        camera = frame and frame.world_from_camera.to_transform()
        projector = frame and frame.projector_from_camera.to_transform()
        if camera is None or projector is None:
            raise InputError(
                f"has no poses of the frame {row.name}", "truth",
                "give the truth of the same sequence, with all of its frames",
            )  # fmt: skip
        out.append((camera, projector))
    return out

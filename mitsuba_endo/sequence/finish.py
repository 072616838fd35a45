"""After the last frame: parts joined and adjusted, and the frames with what that gave."""

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from ..geometry.projection_models import ProjectorModel
from ..records.rig import Rig
from ..records.trajectory import FrameRow
from .adjustment.drift_and_gauge import Plan
from .adjustment.refusion import FinishedPart, FinishedPose, finish_part
from .bootstrap import Beginning
from .joining import Joined, join
from .run import Recorded


@dataclass(frozen=True, eq=False)
class Finished:
    """A sequence after its adjustment."""

    rows: list[FrameRow]
    joined: list[Joined]
    """Parts as they were tracked; those that met are one."""
    parts: list[FinishedPart | None]
    """The same adjusted; None where one stays as it was tracked."""
    main: int
    """The part with the most frames."""
    projector: ProjectorModel


def finish(recorded: Recorded) -> Finished:
    """Join parts that meet, and adjust each, the largest one first: it tells the focal length."""
    beginning = recorded.beginning
    if beginning is None:
        raise ValueError("nothing was recorded before the first frames were calibrated")
    plan, projector = _plan(recorded.rig, beginning), beginning.setup.projector
    finished: dict[int, FinishedPart | None] = {}
    with threadpool_limits(1, "blas"):
        joined, rows = join(recorded)
        main = int(np.bincount([row.part for row in rows if not row.lost]).argmax())
        for number in sorted(range(len(joined)), key=lambda k: k != main):
            held = plan if number == main else replace(plan, focal_free=False)
            finished[number] = _adjusted(joined[number], projector, held)
            first = finished[main]
            projector = projector if first is None else first.adjusted.projector
    parts = [finished[k] for k in range(len(joined))]
    return Finished([_row(row, parts) for row in rows], joined, parts, main, projector)


def _plan(rig: Rig, beginning: Beginning) -> Plan:
    return Plan(
        beginning.setup.drift, rig.projector.focal.refine and rig.share.focal != "fixed",
        rig.share.projector_pose == "fixed",
    )  # fmt: skip


def _adjusted(part: Joined, projector: ProjectorModel, plan: Plan) -> FinishedPart | None:
    return finish_part(part.views, part.volume, projector, plan, part.setup.seed)


def _row(row: FrameRow, parts: list[FinishedPart | None]) -> FrameRow:
    part = None if row.lost else parts[row.part]
    finished: FinishedPose | None = None if part is None else part.poses.get(row.number)
    if finished is None:
        return row
    std = np.sqrt(np.maximum(np.diag(finished.covariance), 0.0))
    return replace(
        row, world_from_camera=finished.poses.world_from_camera,
        projector_from_camera=finished.poses.projector_from_camera, projector_std=std[:6],
        camera_std=std[6:] if std[6:].any() else None, noise_px=finished.noise,
    )  # fmt: skip

"""Frames of a tracked sequence, and their poses beside the true ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import INTERVAL, Solution
from ..records.trajectory import FrameRow
from .alignment import Similarity
from .metric_value import root_mean_square
from .trajectory_errors import absolute_trajectory_error, relative_pose_error, trajectory_alignment

APART = 10
"""Frames over which motions are compared."""
WINDOW = 100
"""Frames in a row over which the scale is compared, every half of as many."""


@dataclass(frozen=True, eq=False)
class TrackedFrames:
    """What is compared: the frames of a sequence's largest part."""

    solution: Solution
    rows: Sequence[FrameRow]
    """All frames."""
    surface: SurfaceEstimate | None
    """Of the part, in its world."""

    @cached_property
    def placed(self) -> list[FrameRow]:
        """Frames of the part with the most."""
        with_pose = [row for row in self.rows if not row.lost]
        parts = [row.part for row in with_pose]
        return [row for row in with_pose if row.part == max(set(parts), key=parts.count)]


class PosePairs:
    """Poses found and true, either in the world of the first placed camera."""

    def __init__(
        self, rows: Sequence[FrameRow], true: list[tuple[RigidTransform, RigidTransform]]
    ) -> None:
        self.rows = rows
        cameras = [row.world_from_camera for row in rows if row.world_from_camera is not None]
        self.base = cameras[0].inverse()
        """first_from_world, found."""
        self.true_base = true[0][0].inverse()
        self.found = [self.base @ pose for pose in cameras]
        self.true = [self.true_base @ pose for pose, _ in true]
        self.true_projector = [pose for _, pose in true]

    def first_error(self) -> float:
        by = Similarity.identity()
        return root_mean_square(absolute_trajectory_error(self.found, self.true, by))

    def motions(self, scale: float) -> dict[str, Any]:
        """Return errors of motions over some frames, and from the first frame to the last."""
        scaled = [RigidTransform(pose.R, scale * pose.t) for pose in self.found]
        apart = min(APART, len(scaled) - 1)
        shift, turn = relative_pose_error(scaled, self.true, apart)
        end, _ = relative_pose_error(scaled, self.true, len(scaled) - 1)
        return {
            "rpe_shift_rms_mm": root_mean_square(shift),
            "rpe_turn_rms_deg": float(np.degrees(root_mean_square(turn))),
            "last_to_first_mm": float(end[0]),
        }

    def scale_errors(self) -> dict[str, Any]:
        """Return how much too long the way is, and the part of it with the largest error, %."""
        starts = range(0, max(len(self.found) - WINDOW, 0) + 1, WINDOW // 2)
        parts = [self._scale_error(slice(k, k + WINDOW)) for k in starts]
        return {
            "scale_error_percent": self._scale_error(slice(None)),
            "scale_worst_percent": max(parts, key=abs),
        }

    def _scale_error(self, frames: slice) -> float:
        by = trajectory_alignment(self.found[frames], self.true[frames], "similarity")
        return 100 * (1 / by.scale - 1)

    def held(self, what: str) -> float | None:
        """Return the share of the 95 % intervals of poses' components that hold the truth, %."""
        inside = []
        for k, row in enumerate(self.rows):
            pose, std = row.world_from_camera, row.camera_std
            true = self.base.inverse() @ self.true[k]
            if what == "projector":
                pose, std, true = (
                    row.projector_from_camera,
                    row.projector_std,
                    self.true_projector[k],
                )
            if std is None or pose is None:
                continue
            turned = Rotation.from_matrix(pose.R @ true.R.T).as_rotvec()
            inside.append(np.abs(np.concatenate([turned, pose.t - true.t])) < INTERVAL * std)
        return 100 * float(np.mean(inside)) if inside else None

"""Poses of a solution's frames as a table and as trajectories, for spreadsheets and ``evo``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..records.solution import Frame, PoseEstimate, Solution
from ..records.trajectory import FrameRow, save_tum

FRAMES = "frames.csv"


def save_trajectories(folder: Path, rows: Sequence[FrameRow], suffix: str = "") -> None:
    """Write where camera and projector were, times being the frames' numbers from 0.

    Args:
        folder: of ``trajectory_camera.tum`` and ``trajectory_projector.tum``.
        rows: of the frames; those without a pose are left out.
        suffix: before ``.tum`` in the files' names.

    Raises:
        InputError: a file cannot be written.
    """
    cameras = [(r.number, r.world_from_camera) for r in rows if r.world_from_camera is not None]
    projectors = [
        (r.number, r.world_from_projector) for r in rows if r.world_from_projector is not None
    ]
    save_tum(folder / f"trajectory_camera{suffix}.tum", cameras)
    save_tum(folder / f"trajectory_projector{suffix}.tum", projectors)


def frame_rows(solution: Solution) -> list[FrameRow]:
    """Return a row for every frame, and for those left out, with the reason."""
    pixels = None if solution.camera is None else solution.camera.width * solution.camera.height
    rows = [_row(k, frame, pixels) for k, frame in enumerate(solution.frames)]
    return rows + [
        FrameRow(len(rows) + k, out.name, lost=out.reason)
        for k, out in enumerate(solution.left_out)
    ]


def _row(number: int, frame: Frame, pixels: int | None) -> FrameRow:
    camera, projector = frame.world_from_camera, frame.projector_from_camera
    return FrameRow(
        number,
        frame.name,
        world_from_camera=camera.to_transform(),
        projector_from_camera=projector.to_transform(),
        camera_std=_std(camera),
        projector_std=_std(projector),
        rms_px=frame.rms_px,
        coverage=None if frame.used is None or pixels is None else frame.used / pixels,
    )


def _std(pose: PoseEstimate) -> np.ndarray | None:
    return None if pose.std is None else np.array(pose.std, float)

"""Poses, focal length and lost frames of a sequence over its frames."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..evaluate.tracked_frames import TrackedFrames
from ..geometry.transforms import RigidTransform
from ..records.solution import INTERVAL, Solution
from ..records.trajectory import FrameRow
from .margins import Margins

Floats = NDArray[np.float64]

AXES = ("x", "y", "z")
COLOURS = ("#0072b2", "#d55e00", "#009e73")
"""Of x, y and z; of Okabe and Ito's palette."""
LOST = "#9c9c9c"
BAND = 0.25
"""Opacity of a 95 % interval. Chosen for looks."""
Values = tuple[Floats, Floats | None]
"""(3,) of a frame and their standard deviations, if they are known."""


def track_figure(tracked: TrackedFrames) -> Figure:
    """Draw camera and projector of every placed frame with their 95 % intervals.

    The projector is drawn as it moved since the first frame; lost frames are grey.
    """
    unit = "mm" if tracked.solution.units == "mm" else "baselines"
    rows, first = tracked.placed, _first_projector(tracked.placed)
    panels: list[tuple[str, Callable[[FrameRow], Values]]] = [
        (f"camera, {unit}", _camera_shift), ("camera, degrees", _camera_turn),
        (f"projector moved, {unit}", lambda row: _projector_shift(row, first)),
        ("projector turned, degrees", lambda row: _projector_turn(row, first)),
    ]  # fmt: skip
    figure = Figure(figsize=(7, 10.5), layout=Margins())
    drawn = figure.subplots(len(panels) + 1, sharex=True)
    for axes, (title, values) in zip(drawn, panels, strict=False):
        _components(axes, rows, values)
        axes.set_ylabel(title)
    _focal(drawn[-1], tracked.solution, len(tracked.rows))
    for axes in drawn:
        _grey(axes, tracked.rows)
    drawn[0].legend(loc="upper left", ncols=4, fontsize="small")
    drawn[-1].set_xlabel("frame")
    return figure


def _components(axes: Axes, rows: Sequence[FrameRow], values: Callable[[FrameRow], Values]) -> None:
    numbers = np.array([row.number for row in rows], float)
    estimates = [values(row) for row in rows]
    missing = np.full(3, np.nan)
    mean = np.array([value for value, _ in estimates])
    half = INTERVAL * np.array([missing if std is None else std for _, std in estimates])
    for k, (name, colour) in enumerate(zip(AXES, COLOURS, strict=True)):
        x, y, band = _with_gaps(numbers, mean[:, k], half[:, k])
        axes.plot(x, y, color=colour, label=name, linewidth=1)
        axes.fill_between(x, y - band, y + band, color=colour, alpha=BAND, linewidth=0)


def _with_gaps(x: Floats, *values: Floats) -> tuple[Floats, ...]:
    """Return the curves with NaN where frames are missing, so that no line bridges them."""
    after = np.flatnonzero(np.diff(x) > 1) + 1
    return np.insert(x, after, np.nan), *(np.insert(v, after, np.nan) for v in values)


def _grey(axes: Axes, rows: Sequence[FrameRow]) -> None:
    label = "lost"
    for row in rows:
        if row.lost:
            axes.axvspan(row.number - 0.5, row.number + 0.5, color=LOST, alpha=0.4, label=label)
            label = "_lost"


def _focal(axes: Axes, solution: Solution, count: int) -> None:
    focal = solution.projector.focal
    axes.set_ylabel("focal length, pattern px")
    if not isinstance(focal.value, float):
        return
    ends = np.array([-0.5, count - 0.5])
    axes.plot(ends, np.full(2, focal.value), color=COLOURS[0], linewidth=1)
    if isinstance(focal.std, float):
        half = INTERVAL * focal.std
        axes.fill_between(ends, focal.value - half, focal.value + half, color=COLOURS[0],
                          alpha=BAND, linewidth=0)  # fmt: skip


def _camera_shift(row: FrameRow) -> Values:
    assert row.world_from_camera is not None
    return row.world_from_camera.t, None if row.camera_std is None else row.camera_std[3:]


def _camera_turn(row: FrameRow) -> Values:
    assert row.world_from_camera is not None
    return _degrees(row.world_from_camera), _turn_std(row.camera_std)


def _first_projector(rows: Sequence[FrameRow]) -> RigidTransform:
    return next(row.projector_from_camera for row in rows if row.projector_from_camera is not None)


def _projector_shift(row: FrameRow, first: RigidTransform) -> Values:
    assert row.projector_from_camera is not None
    std = None if row.projector_std is None else row.projector_std[3:]
    return row.projector_from_camera.t - first.t, std


def _projector_turn(row: FrameRow, first: RigidTransform) -> Values:
    assert row.projector_from_camera is not None
    moved = RigidTransform(row.projector_from_camera.R @ first.R.T, first.t)
    return _degrees(moved), _turn_std(row.projector_std)


def _degrees(pose: RigidTransform) -> Floats:
    return np.degrees(Rotation.from_matrix(pose.R).as_rotvec())


def _turn_std(std: Floats | None) -> Floats | None:
    return None if std is None else np.degrees(std[:3])

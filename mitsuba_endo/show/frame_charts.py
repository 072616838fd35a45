"""What was found frame by frame, as plots over the frames."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..records.solution import INTERVAL, Frame, PoseEstimate, Solution
from .margins import Margins
from .solution_values import unit_name

Floats = NDArray[np.float64]

_AXES = (("x", "#0072b2"), ("y", "#d55e00"), ("z", "#009e73"))
"""Of Okabe and Ito's palette."""


def frame_charts(solution: Solution) -> list[tuple[str, Figure]]:
    """Return named plots over the frames: fit, poses of projector and camera with intervals."""
    frames, unit = solution.frames, unit_name(solution)
    out = [("residuals over the frames", _fit(solution))]
    for device, of in (
        ("projector", lambda f: f.projector_from_camera), ("camera", lambda f: f.world_from_camera),
    ):  # fmt: skip
        poses = [of(frame) for frame in frames]
        if len({str(pose.t) for pose in poses}) > 1:
            out.append((f"{device} over the frames", _poses(device, frames, of, unit)))
    return out


def _fit(solution: Solution) -> Figure:
    figure = Figure(figsize=(7, 4.6), layout=Margins())
    above, below = figure.subplots(2, sharex=True)
    number = np.arange(1, len(solution.frames) + 1)
    above.plot(number, [_number(f.rms_px) for f in solution.frames], "o-", ms=3, color=_AXES[0][1])
    above.set(ylabel="residual RMS,\npattern px", title="Fit of every frame")
    pixels = None if solution.camera is None else solution.camera.width * solution.camera.height
    used = np.array([_number(f.used) for f in solution.frames])
    below.plot(number, 100 * used / pixels if pixels else used, "o-", ms=3, color=_AXES[1][1])
    below.set(ylabel="pixels used, %" if pixels else "pixels used", xlabel="frame")
    for axes in (above, below):
        axes.set_ylim(0, None)
        _finish(axes)
    return figure


def _poses(
    device: str, frames: Sequence[Frame], of: Callable[[Frame], PoseEstimate], unit: str
) -> Figure:
    figure = Figure(figsize=(7, 4.6), layout=Margins())
    above, below = figure.subplots(2, sharex=True)
    estimates = np.array([_six(of(frame)) for frame in frames])
    number = np.arange(1, len(frames) + 1)
    for axes, part, label in ((above, 3, f"translation, {unit}"), (below, 0, "rotation, deg")):
        for k, (name, colour) in enumerate(_AXES):
            value, std = estimates[:, part + k, 0], estimates[:, part + k, 1]
            axes.plot(number, value, "o-", ms=2.5, lw=1, color=colour, label=name)
            low, high = value - INTERVAL * std, value + INTERVAL * std
            axes.fill_between(number, low, high, color=colour, alpha=0.25, lw=0)
        axes.set(ylabel=label)
        _finish(axes)
    above.set_title(f"{device.capitalize()} of every frame, 95 % intervals as bands")
    above.legend(ncols=3, fontsize="x-small", loc="best")
    below.set_xlabel("frame")
    return figure


def _six(pose: PoseEstimate) -> Floats:
    """Return values and deviations (6, 2): rotation vector, degrees, and translation."""
    transform = pose.to_transform()
    if transform is None:
        return np.full((6, 2), np.nan)
    turned = np.degrees(Rotation.from_matrix(transform.R).as_rotvec())
    std = np.zeros(6) if pose.std is None else np.array(pose.std)
    std = np.concatenate([np.degrees(std[:3]), std[3:]])
    return np.stack([np.concatenate([turned, transform.t]), std], -1)


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)


def _finish(axes: Axes) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.grid(color="0.9", lw=0.6)

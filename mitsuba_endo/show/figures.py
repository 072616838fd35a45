"""Figures of a calibration: functions from records to matplotlib figures, no global state."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from ..files import atomic_path
from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration, FrameMaps, TraceRow
from ..records.solution import Solution
from . import panels
from .frame_poses import frame_poses
from .margins import BAR, Margins
from .solution_values import headline, unit_name
from .view import SurfaceView

DPI = 110
"""Pixels per inch of a picture. Chosen for looks."""
_PANEL_AREA = 13.0  # square inches of image in a panel
_MAX_COLUMNS = 4
"""Panels beside one another. Chosen for looks."""
NARROW = 26
"""Unknowns up to which each has a row; more would be too small to read."""
_ROW_INCHES = 0.15
"""Height of a row in which a label can be read."""
_MAX_NUMBERED = 14
"""Unknowns up to which a correlation matrix has room for its numbers."""


def save_figure(path: str | Path, figure: Figure) -> None:
    """Write a figure as PNG.

    Raises:
        InputError: the file cannot be written.
    """
    with atomic_path(path) as aside:
        figure.savefig(aside, dpi=DPI, format="png")


def coordinates_figure(
    frames: Sequence[FrameMaps], which: Literal["observed", "rendered"]
) -> Figure:
    """Draw the maps of projector coordinates, x and y side by side, a pair for every frame.

    Observed and rendered maps share their colour scale.
    """
    limits = [panels.coordinate_limits(frames, c) for c in (0, 1)]
    figure, axes = _grid(frames)
    for frame, pair in zip(frames, axes, strict=True):
        image = frame.observed if which == "observed" else frame.rendered
        for c in (0, 1):
            title = f"{which.capitalize()} projector {'xy'[c]}{_of(frame, frames)}"
            panels.coordinate(pair[c], image[..., c], limits[c], title)
    return figure


def residual_figure(frames: Sequence[FrameMaps]) -> Figure:
    """Draw observed - rendered, signed, x and y side by side, a pair for every frame."""
    limit = panels.residual_range(frames)
    figure, axes = _grid(frames)
    for frame, pair in zip(frames, axes, strict=True):
        for c in (0, 1):
            title = f"Residual {'xy'[c]}{_of(frame, frames)}"
            panels.residual(pair[c], frame, c, limit, title)
    return figure


def histogram_figure(
    frames: Sequence[FrameMaps], noise_px: float | None = None, scale_px: float | None = None
) -> Figure:
    """Draw the distribution of the residuals.

    Args:
        frames: maps with their residuals.
        noise_px: standard deviation of a normal distribution to compare with, pattern pixels.
        scale_px: scale of the robust loss, pattern pixels.
    """
    figure = Figure(figsize=(7, 4.5), layout=Margins())
    panels.residual_histogram(figure.subplots(), frames, noise_px, scale_px)
    return figure


def convergence_figure(trace: list[TraceRow]) -> Figure:
    """Draw cost and, where it is one number, focal length against the iteration."""
    with_focal = any(row.focal is not None for row in trace)
    figure = Figure(figsize=(7, 7 if with_focal else 4), layout=Margins())
    axes = np.atleast_1d(figure.subplots(2 if with_focal else 1, sharex=True))
    panels.trace_cost(axes[0], trace)
    if with_focal:
        panels.trace_focal(axes[1], trace)
    axes[-1].set_xlabel("iteration")
    if trace:
        last = trace[-1]
        count = f"{last.iteration} iteration{'' if last.iteration == 1 else 's'}"
        axes[0].set_title(f"{count}, {last.seconds:.1f} s")
    return figure


def surface_figure(
    view: SurfaceView, unit: str, error: NDArray[np.float64] | None = None
) -> Figure:
    """Draw the depth of the surface in the first camera and, if known, uncertainty and error.

    Args:
        view: the surface.
        unit: of length.
        error: (H, W) found minus true range along the camera's rays.
    """
    drawn = _surface_panels(view, unit, error)
    height, width = view.depth.shape
    count = len(drawn)
    size = np.array(_size(width, height, count, 1)) * min(1.0, 2.2 / count)  # keeps text readable
    figure = Figure(figsize=(size[0], size[1]), layout="constrained")
    for axes, draw in zip(np.atleast_1d(figure.subplots(1, count)), drawn, strict=True):
        draw(axes)
    return figure


def _surface_panels(
    view: SurfaceView, unit: str, error: NDArray[np.float64] | None
) -> list[Callable[[Axes], None]]:
    drawn = [partial(panels.depth, view=view, unit=unit, title="Surface in the first camera")]
    if view.std is not None:
        drawn.append(partial(panels.surface_std, view=view, unit=unit))
    if error is not None:
        drawn.append(partial(panels.surface_error, error=error, unit=unit))
    return drawn


def rig_figure(calibration: Calibration, view: SurfaceView) -> Figure:
    """Draw camera, projectors and surface from above."""
    figure = Figure(figsize=(7, 4.5), layout=Margins())
    projectors, unit = projector_poses(calibration.solution), unit_name(calibration.solution)
    panels.rig_section(figure.subplots(), view, calibration.camera, projectors, unit)
    return figure


def correlation_figure(unknowns: list[str], matrix: list[list[float | None]]) -> Figure:
    """Draw the correlation matrix of the unknowns; grey where one has no variance.

    Of many unknowns every row is what belongs together, a pose or a focal length, and every cell
    the strongest correlation between two of them.
    """
    values = np.array([[np.nan if v is None else v for v in row] for row in matrix])
    title = "Correlation of the unknowns"
    if len(unknowns) > NARROW:
        unknowns, values = strongest(unknowns, values)
        title = "Strongest correlation between unknowns of each group"
    side = max(5.0, _ROW_INCHES * len(unknowns))
    figure = Figure(figsize=(side + 2, side), layout=Margins(right=BAR))
    numbers = len(unknowns) <= _MAX_NUMBERED
    panels.correlation(figure.subplots(), unknowns, values, numbers=numbers, title=title)
    return figure


def strongest(unknowns: list[str], values: NDArray[Any]) -> tuple[list[str], NDArray[Any]]:
    """Return groups of unknowns and the largest correlations (G, G) between them, with signs.

    An unknown ``projector pose of a.exr (translation z)`` is of the group before the bracket.
    """
    groups = [name.split(" (")[0] for name in unknowns]
    names = list(dict.fromkeys(groups))
    members = [np.flatnonzero([group == name for group in groups]) for name in names]
    out = np.full((len(names), len(names)), np.nan)
    for i, rows in enumerate(members):
        for j, columns in enumerate(members):
            block = values[np.ix_(rows, columns)].copy()
            if i == j and len(rows) > 1:
                np.fill_diagonal(block, np.nan)
            if np.isfinite(block).any():
                out[i, j] = block.ravel()[np.nanargmax(np.abs(block))]
    return names, out


def overview_figure(calibration: Calibration, view: SurfaceView) -> Figure:
    """Draw what tells a good calibration from a bad one at one look: maps, residuals, surface.

    Shows the first frame's x maps, the residuals of the frame that fits worst, all residuals'
    distribution, the surface and the rig; the numbers are in the title.
    """
    frames, solution = calibration.frames, calibration.solution
    unit = unit_name(solution)
    height, width = view.depth.shape
    size = _size(width, height, 3, 2)
    figure = Figure(
        figsize=(size[0], size[1] + 0.6), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08)
    )
    axes = figure.subplots(2, 3)
    limits = panels.coordinate_limits(frames, 0)
    first, worst = frames[0], max(frames, key=lambda f: panels.residual_range([f]))
    panels.coordinate(
        axes[0, 0], first.observed[..., 0], limits, f"Observed projector x{_of(first, frames)}"
    )
    panels.coordinate(
        axes[0, 1], first.rendered[..., 0], limits, f"Rendered projector x{_of(first, frames)}"
    )
    limit = panels.residual_range([worst])
    panels.residual(axes[0, 2], worst, 0, limit, f"Residual x{_of(worst, frames, 'worst: ')}")
    panels.depth(axes[1, 0], view, unit)
    panels.rig_section(axes[1, 1], view, calibration.camera, projector_poses(solution), unit)
    scale = calibration.trace[-1].scale_px if calibration.trace else None
    panels.residual_histogram(axes[1, 2], frames, solution.noise_px, scale)
    figure.suptitle(headline(solution))
    return figure


def projector_poses(solution: Solution) -> list[RigidTransform]:
    """Return every known projector's pose in the first camera's frame."""
    poses = [at.first_from_projector for at in frame_poses(solution)]
    return [pose for pose in poses if pose is not None]


def _of(frame: FrameMaps, frames: Sequence[FrameMaps], prefix: str = "") -> str:
    return f"\n{prefix}{frame.name}" if len(frames) > 1 else ""


def _grid(frames: Sequence[FrameMaps]) -> tuple[Figure, Any]:
    """Return a figure with two panels for every frame, and its axes (frames, 2)."""
    height, width = frames[0].observed.shape[:2]
    pairs = 1 if len(frames) <= 2 else min(_MAX_COLUMNS // 2, len(frames))
    rows = math.ceil(len(frames) / pairs)
    figure = Figure(figsize=_size(width, height, 2 * pairs, rows), layout="constrained")
    axes = figure.subplots(rows, 2 * pairs, squeeze=False).reshape(rows * pairs, 2)
    for spare in axes[len(frames) :].ravel():
        spare.set_visible(False)
    return figure, axes[: len(frames)]


def _size(width: int, height: int, columns: int, rows: int) -> tuple[float, float]:
    """Return a figure's size in inches, with panels of the image's shape and equal area."""
    panel_width = min(max(math.sqrt(_PANEL_AREA * width / height), 2.6), 6.0)
    panel_height = panel_width * height / width
    return columns * (panel_width + 1.1), rows * (panel_height + 0.75)

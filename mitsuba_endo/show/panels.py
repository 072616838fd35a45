"""What one pair of axes shows; each function draws into axes it is given."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import FrameMaps, TraceRow
from .colours import CAMERA, DEPTH, MISSING, PROJECTOR, RESIDUAL, UNUSED, banded, shaded
from .surface_colours import UNCERTAINTY
from .view import SurfaceView

PX = "pattern px"
_DARK = 0.65
"""Correlation from which its colour is too dark for black text."""
_DENSE = 30
"""Unknowns from which their names must be small."""


def image_axes(axes: Axes, title: str) -> None:
    """Label axes whose unit is the camera pixel."""
    axes.set_title(title)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.tick_params(labelsize="x-small")


def coordinate(axes: Axes, q: NDArray[Any], limits: NDArray[Any], title: str) -> None:
    """Draw one channel (H, W) of a map of projector coordinates, pattern pixels."""
    scale, norm, step = banded(float(limits[0]), float(limits[1]))
    shown = axes.imshow(q, cmap=scale, norm=norm, interpolation="nearest")
    bar = axes.figure.colorbar(shown, ax=axes, shrink=0.85, pad=0.02, aspect=25)
    bar.set_label(f"{PX}, bands of {step:g}", size="small")
    bar.ax.tick_params(labelsize="x-small")
    image_axes(axes, title)


def coordinate_limits(frames: Sequence[FrameMaps], channel: int) -> NDArray[np.float64]:
    """Return the range of a channel over all frames, without the farthest percent of outliers."""
    values = np.concatenate([f.observed[..., channel][f.used] for f in frames])
    rendered = np.concatenate([f.rendered[..., channel].ravel() for f in frames])
    values = np.concatenate([values, rendered])
    values = values[np.isfinite(values)]
    if not len(values):
        return np.array([0.0, 1.0])
    return np.percentile(values.astype(np.float64), [0.5, 99.5])


def residual_range(frames: Sequence[FrameMaps]) -> float:
    """Return the residual, pattern pixels, that 98 % of those used stay within."""
    values = np.concatenate([np.abs(f.residual[f.used]).ravel() for f in frames])
    values = values[np.isfinite(values)]
    return max(float(np.percentile(values, 98)), 1e-6) if len(values) else 1.0


def residual(axes: Axes, frame: FrameMaps, channel: int, limit: float, title: str) -> None:
    """Draw observed - rendered of one channel, signed, pattern pixels."""
    values = np.where(frame.used, frame.residual[..., channel], np.nan)
    scale = matplotlib.colormaps[RESIDUAL].with_extremes(bad=MISSING)
    shown = axes.imshow(values, cmap=scale, vmin=-limit, vmax=limit, interpolation="nearest")
    unused = np.isfinite(frame.observed).all(-1) & ~frame.used
    if unused.any():
        overlay = np.zeros((*unused.shape, 4))
        overlay[unused] = to_rgba(UNUSED)
        axes.imshow(overlay, interpolation="nearest")
        axes.legend(
            handles=[Patch(color=UNUSED, label="not used")], loc="lower right", fontsize="x-small"
        )
    bar = axes.figure.colorbar(shown, ax=axes, extend="both", shrink=0.85, pad=0.02, aspect=25)
    bar.set_label(f"observed - rendered, {PX}", size="small")
    bar.ax.tick_params(labelsize="x-small")
    image_axes(axes, title)


def residual_histogram(
    axes: Axes, frames: Sequence[FrameMaps], noise_px: float | None, scale_px: float | None
) -> None:
    """Draw the distribution of the residuals used, with a normal one and the robust scale."""
    limit = 2.5 * residual_range(frames)
    edges = np.linspace(-limit, limit, 121)
    for channel, colour in enumerate((CAMERA, PROJECTOR)):
        values = np.concatenate([f.residual[..., channel][f.used] for f in frames])
        values = values[np.isfinite(values)]
        label = "xy"[channel]
        if len(values):
            label += f", median |r| {np.median(np.abs(values)):.3g} px"
            density = np.histogram(values, edges)[0] / len(values) / np.diff(edges)
            axes.stairs(density, edges, color=colour, label=label)
    if noise_px:
        curve = np.exp(-0.5 * (edges / noise_px) ** 2) / (noise_px * np.sqrt(2 * np.pi))
        axes.plot(edges, curve, color="k", lw=0.8, ls="--", label=f"normal, {noise_px:.3g} px")
    if scale_px is not None and scale_px < limit:
        label = f"robust scale, {scale_px:.3g} px"
        for x in (-scale_px, scale_px):
            axes.axvline(x, color="0.5", lw=0.9, ls=":", label=label if x > 0 else None)
    axes.set(xlabel=f"observed - rendered, {PX}", ylabel="density, 1/px", title="Residuals")
    axes.set_xlim(-limit, limit)
    axes.locator_params(axis="x", nbins=5)  # small residuals have long labels
    axes.set_ylim(0, 1.3 * axes.get_ylim()[1])  # room for the legend
    axes.legend(fontsize="x-small", loc="upper right")


def depth(axes: Axes, view: SurfaceView, unit: str, title: str = "Surface") -> None:
    """Draw the depth of the surface in the camera, shaded to show its relief."""
    finite = view.depth[np.isfinite(view.depth)]
    limits = np.percentile(finite, [1, 99]) if len(finite) else np.array([0.0, 1.0])
    norm = Normalize(float(limits[0]), float(max(limits[1], limits[0] + 1e-9)))
    axes.imshow(shaded(view.depth, view.normals, DEPTH, norm), interpolation="nearest")
    _value_bar(axes, norm, DEPTH, f"depth, {unit}")
    image_axes(axes, title)


def surface_std(axes: Axes, view: SurfaceView, unit: str) -> None:
    """Draw the standard deviation of the surface along the viewing rays."""
    if view.std is None:
        raise ValueError("the surface has no standard deviations")
    finite = view.std[np.isfinite(view.std)]
    norm = Normalize(0, float(np.percentile(finite, 98)) if len(finite) else 1.0)
    scale = matplotlib.colormaps[UNCERTAINTY].with_extremes(bad=MISSING)
    axes.imshow(view.std, cmap=scale, norm=norm, interpolation="nearest")
    _value_bar(axes, norm, UNCERTAINTY, f"standard deviation, {unit}", extend="max")
    image_axes(axes, "Uncertainty of the surface")


def surface_error(axes: Axes, error: NDArray[np.float64], unit: str) -> None:
    """Draw found minus true range (H, W) along the viewing rays, signed."""
    magnitudes = np.abs(error[np.isfinite(error)])
    top = float(np.percentile(magnitudes, 98)) if len(magnitudes) else 1.0
    norm = Normalize(-top, top)
    scale = matplotlib.colormaps[RESIDUAL].with_extremes(bad=MISSING)
    axes.imshow(error, cmap=scale, norm=norm, interpolation="nearest")
    _value_bar(axes, norm, RESIDUAL, f"found - true range, {unit}")
    image_axes(axes, "Error to the truth")


def _value_bar(axes: Axes, norm: Normalize, scale: str, label: str, extend: str = "both") -> None:
    mappable = ScalarMappable(norm, scale)
    bar = axes.figure.colorbar(mappable, ax=axes, extend=extend, shrink=0.85, pad=0.02, aspect=25)
    bar.set_label(label, size="small")
    bar.ax.tick_params(labelsize="x-small")


def rig_section(
    axes: Axes,
    view: SurfaceView,
    camera: CameraModel,
    projectors: list[RigidTransform],
    unit: str,
) -> None:
    """Draw the rig from above: x to the right, z up; the surface where the middle row sees it.

    Args:
        axes: where to draw.
        view: the surface in the first camera.
        camera: for its field of view.
        projectors: camera_from_projector of each projector, first camera's frame.
        unit: of length.
    """
    row = view.points[view.points.shape[0] // 2]
    axes.plot(row[:, 0], row[:, 2], color="0.25", lw=1.5, label="surface, middle row")
    far = np.nanmedian(view.depth) if np.isfinite(view.depth).any() else 1.0
    middle = camera.height / 2
    edges = camera.rays(np.array([[0, middle], [camera.width - 1, middle]], float))
    for ray in edges * far * 0.35:
        axes.plot([0, ray[0]], [0, ray[2]], color=CAMERA, lw=0.8)
    axes.plot(0, 0, "o", color=CAMERA, label="camera")
    for i, pose in enumerate(projectors):
        tip = pose.apply(np.array([0, 0, far * 0.35]))
        axes.plot([pose.t[0], tip[0]], [pose.t[2], tip[2]], color=PROJECTOR, lw=0.8)
        label = "projector and its axis" if i == 0 else None
        axes.plot(pose.t[0], pose.t[2], "s", ms=4, color=PROJECTOR, label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=5)  # more labels run into one another in a narrow panel
    axes.set(xlabel=f"x, {unit}", ylabel=f"z, {unit}", title="Rig from above")
    axes.legend(fontsize="x-small", loc="best")
    axes.grid(color="0.9", lw=0.6)


def trace_cost(axes: Axes, trace: list[TraceRow]) -> None:
    """Draw the cost per iteration under one loss, that of the end; of old traces their own."""
    fixed = all(row.fixed_cost is not None for row in trace)
    costs = np.array([row.fixed_cost if fixed else row.cost for row in trace], float)
    axes.plot([row.iteration for row in trace], costs, "o-", ms=3, color=CAMERA)
    if len(costs) and costs.min() > 0 and costs.max() > 3 * costs.min():
        axes.set_yscale("log")
    axes.set(ylabel="cost per correspondence" + (",\nunder the final loss" if fixed else ""))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="0.9", lw=0.6)


def trace_focal(axes: Axes, trace: list[TraceRow]) -> None:
    """Draw the focal length per iteration."""
    rows = [row for row in trace if row.focal is not None]
    axes.plot(
        [r.iteration for r in rows], [r.focal or 0 for r in rows], "o-", ms=3, color=PROJECTOR
    )
    axes.set(ylabel=f"focal length, {PX}")
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(color="0.9", lw=0.6)


def correlation(
    axes: Axes, unknowns: list[str], values: NDArray[np.float64], numbers: bool, title: str
) -> None:
    """Draw a correlation matrix (N, N), NaN in grey, with its numbers where there is room."""
    scale = matplotlib.colormaps[RESIDUAL].with_extremes(bad=MISSING)
    edges = np.arange(len(unknowns) + 1) - 0.5
    shown = axes.pcolormesh(
        edges, edges, np.ma.masked_invalid(values), cmap=scale, vmin=-1, vmax=1, edgecolors="w",
        linewidth=0.5,
    )  # fmt: skip
    if numbers:
        for (row, column), value in np.ndenumerate(values):
            if np.isfinite(value):
                colour = "w" if abs(value) > _DARK else "k"
                text = f"{value:.2f}".replace("-0.00", "0.00")
                axes.text(column, row, text, color=colour, size=6, ha="center", va="center")
    size = "x-small" if len(unknowns) <= _DENSE else 7
    counted = [str(i + 1) for i in range(len(unknowns))]
    named = [f"{name}   {i}" for name, i in zip(unknowns, counted, strict=True)]
    axes.set_xticks(range(len(unknowns)), counted, size=size)
    axes.set_yticks(range(len(unknowns)), named, size=size)
    axes.tick_params(length=0)
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.set_title(title)
    axes.figure.colorbar(shown, ax=axes, shrink=0.6, aspect=25).ax.tick_params(labelsize="x-small")

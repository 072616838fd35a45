"""Pictures of surfaces and bars that the experiments share."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from mitsuba_endo.evaluate.depth import RayCaster
from mitsuba_endo.evaluate.polyp_size import PolypSize
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of Okabe and Ito, told apart by colour-blind readers."""


def shaded(
    surface: SurfaceEstimate, camera: CameraModel, world_from_camera: RigidTransform | None = None
) -> NDArray[np.float64]:
    """Return a surface as a clay model lit from the camera (H, W), NaN where there is none."""
    pose = world_from_camera or RigidTransform.identity()
    rays = pose.rotate(camera.grid_rays.reshape(-1, 3))
    distance, face = RayCaster(surface.vertices, surface.faces).meet(pose.t, rays)
    a, b, c = np.moveaxis(surface.vertices[surface.faces[face]], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    light = np.abs(np.einsum("ni,ni->n", normal, rays)) ** 1.5
    image = np.where(np.isfinite(distance), light, np.nan)
    return image.reshape(camera.height, camera.width)


def clay(axes: Any, image: NDArray[np.float64], title: str) -> None:
    """Show a shaded surface."""
    axes.imshow(image, cmap="bone", vmin=0, vmax=1.05)
    axes.set_title(title, fontsize=10)
    axes.set_axis_off()


def error_maps(
    axes: Sequence[Any], errors: Mapping[str, NDArray[np.float64]], limit: float
) -> None:
    """Show distances in mm on a common scale with one colour bar."""
    image = None
    for axis, (title, error) in zip(axes, errors.items(), strict=True):
        image = axis.imshow(error, cmap="magma", vmin=0, vmax=limit)
        axis.set_title(title, fontsize=10)
        axis.set_facecolor("0.85")
        axis.set_xticks([])
        axis.set_yticks([])
    axes[0].figure.colorbar(image, ax=list(axes), label="distance from the true surface (mm)")


def bar_groups(found: Mapping[tuple[str, str], Sequence[float]], label: str) -> Figure:
    """Draw bars of medians with every seed's value, a panel for each first part of the keys."""
    groups = list(dict.fromkeys(group for group, _ in found))
    figure = Figure(figsize=(4.5 * len(groups), 3.8), layout="constrained")
    for axes, group in zip(np.atleast_1d(figure.subplots(1, len(groups))), groups, strict=True):
        cases = {case: values for (g, case), values in found.items() if g == group}
        for i, values in enumerate(cases.values()):
            axes.bar(i, float(np.median(values)), 0.6, color=COLOURS[i], alpha=0.4)
            axes.plot([i] * len(values), values, "o", color=COLOURS[i], markersize=4)
        axes.set_xticks(range(len(cases)), [case.replace(", ", "\n") for case in cases])
        axes.set_title(group.replace("_", " "))
        axes.set_ylabel(label)
        _logarithmic(axes)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def dots_by_method(
    values: Mapping[str, Sequence[float]], label: str, published: Mapping[str, float] | None = None
) -> Figure:
    """Draw every seed's value, the median as a bar, and published values as a line."""
    figure = Figure(figsize=(1.6 + 1.5 * len(values), 4), layout="constrained")
    axes = figure.subplots()
    for i, (name, found) in enumerate(values.items()):
        axes.bar(i, float(np.nanmedian(found)), 0.6, color=COLOURS[i], alpha=0.35)
        spot = i + np.linspace(-0.2, 0.2, len(found))
        axes.plot(spot, found, "o", color=COLOURS[i], markersize=4)
        if published and name in published:
            axes.plot([i - 0.35, i + 0.35], [published[name]] * 2, "k--", linewidth=1)
    axes.set_xticks(range(len(values)), list(values))
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def peer_bars(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> Figure:
    """Draw some columns of a table as bars on a logarithmic scale, a group for every law."""
    laws = list(dict.fromkeys(row["law"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    figure = Figure(figsize=(4.4 * len(columns), 4.2), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(columns)))
    for axes, column in zip(panels, columns, strict=True):
        for m, method in enumerate(methods):
            values = [r[column] for r in rows if r["method"] == method]
            at = np.arange(len(laws)) + (m - (len(methods) - 1) / 2) * 0.16
            axes.bar(at, values, 0.15, color=COLOURS[m], label=method)
        _logarithmic(axes)
        axes.set_xticks(range(len(laws)), laws)
        axes.set_title(column)
        axes.spines[["top", "right"]].set_visible(False)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(methods)
    )
    return figure


def curves(
    found: Mapping[str, Sequence[tuple[float, float, float]]], label: str, titles: Sequence[str]
) -> Figure:
    """Draw two errors against one quantity for every method; failures are left out.

    Args:
        found: for every method (quantity, first error, second error).
        label: of the quantity.
        titles: of the errors.
    """
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    panels = figure.subplots(1, 2)
    for i, (axes, title) in enumerate(zip(panels, titles, strict=True)):
        for m, (name, points) in enumerate(found.items()):
            x, y = np.array([(p[0], p[1 + i]) for p in points]).T
            axes.plot(x, y, "o-", color=COLOURS[m], label=name, markersize=4)
        axes.set_xticks(sorted({p[0] for points in found.values() for p in points}))
        _logarithmic(axes)
        axes.set_xlabel(label)
        axes.set_title(title, fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center")
    return figure


def _logarithmic(axes: Any) -> None:
    """Make the vertical axis logarithmic, with plain numbers: the more, the less it spans."""
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    steps = [1.0]
    if high < 200 * low:
        steps = [1.0, 2.0, 5.0] if high > 10 * low else [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0]
    axes.yaxis.set_major_locator(LogLocator(subs=steps, numticks=20))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def sizes_picture(sized: Sequence[tuple[float, PolypSize]], threshold: float) -> Figure:
    """Draw measured against true diameters with their intervals, and the errors' distribution."""
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    true, found = np.array([d for d, _ in sized]), np.array([s.diameter for _, s in sized])
    bars = np.abs(np.array([s.interval for _, s in sized]).T - found)
    covered = np.array([s.interval[0] <= d <= s.interval[1] for d, s in sized])
    for mask, colour, label in (
        (covered, COLOURS[0], "interval covers"), (~covered, COLOURS[1], "interval misses"),
    ):  # fmt: skip
        left.errorbar(true[mask], found[mask], bars[:, mask], fmt="o", color=colour, label=label,
                      markersize=4, elinewidth=1)  # fmt: skip
    ends = [4, 16]
    left.plot(ends, ends, color="0.6", linewidth=1, zorder=0)
    left.axhline(threshold, color="0.6", linestyle=":", zorder=0)
    left.axvline(threshold, color="0.6", linestyle=":", zorder=0)
    left.set(xlim=ends, ylim=ends, aspect="equal", xlabel="true diameter (mm)",
             ylabel="measured diameter (mm)")  # fmt: skip
    left.legend(frameon=False, loc="upper left")
    error = np.sort(np.abs(100 * (found / true - 1)))
    right.step([0, *error], np.arange(len(error) + 1) / len(error), where="post", color=COLOURS[0])
    for value, name in ((7.4, "AI + water jet"), (25.0, "visual estimate")):
        right.plot(value, 0.5, "k|", markersize=14)
        right.annotate(f"{name}\n(median)", (value, 0.5), (value, 0.36), ha="center", fontsize=8)
    right.set(xlabel="absolute error (%)", ylabel="share of the draws", xlim=(0, 30), ylim=(0, 1))
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    return figure

"""The report's pictures: maps, photographs and charts as data URIs."""

from dataclasses import dataclass

from markupsafe import Markup
from matplotlib.figure import Figure

from ..evaluate.tracked_frames import TrackedFrames
from ..records.calibration import Calibration
from . import figures, surface_colours
from .frame_charts import frame_charts
from .report_content import FOLDED
from .result_scene import ResultScene
from .templating import render
from .track_figure import track_figure
from .view import SurfaceView, view_surface
from .web_images import (
    MapImages,
    ShownImage,
    depth_image,
    figure_svg,
    map_pages,
    photograph_uri,
    value_image,
)
from .web_scene import scene_canvas, view_error

_CHART_INCHES = 5.2
"""Width at which the smallest label is readable in half a page."""
_WIDE_INCHES = 10.4
"""Width of a chart that takes the whole page."""
_CONVERGENCE = (
    "The loss that is minimised follows the residuals; drawn is the cost under the loss of the end."
)


@dataclass(frozen=True)
class Picture:
    """An image with the name for those who do not see it."""

    name: str
    source: str
    note: str = ""
    wide: bool = False


@dataclass(frozen=True)
class FramePictures:
    """What is shown of one frame."""

    name: str
    photograph: str
    """Empty where there was none."""
    maps: list[MapImages]
    """Of x and of y."""


def scene_of(scene: ResultScene, view: SurfaceView, number: int) -> Markup:
    """Return the surfaces, cameras and projectors in space."""
    camera = scene.calibration.camera
    return scene_canvas(
        scene, [view, *(view_surface(s, camera) for s in scene.surfaces[1:])], number
    )


def viewer(calibration: Calibration, number: int) -> Markup:
    """Return photographs, observed, rendered and residual maps, with sliders."""
    pages, photographs = map_pages(calibration.frames), calibration.photographs
    names = [frame.name for frame in calibration.frames]
    shown = [
        FramePictures(
            name,
            photograph_uri(photographs[name], pages.shrink) if name in photographs else "",
            images,
        )
        for name, images in zip(names, pages.images, strict=True)
    ]
    return render(
        "viewer.html", frames=shown, number=number, photographed=any(f.photograph for f in shown),
        scales=pages.coordinate_scales, residual_scale=pages.residual_scale,
    )  # fmt: skip


def surfaces(scene: ResultScene, view: SurfaceView) -> list[ShownImage]:
    """Return depth, uncertainty and error of the first surface."""
    images, (height, width) = [depth_image(view, scene.unit)], view.depth.shape
    if view.std is not None:
        shown = surface_colours.uncertainty([view.std.ravel()], scene.unit)
        images.append(value_image(shown, height, width))
    truth = scene.truth
    if truth is not None and truth.surface is not None:
        error = view_error(scene, 0, view).ravel()
        shown = surface_colours.error([error], scene.unit, truth.alignment)
        images.append(value_image(shown, height, width))
    return images


def charts(scene: ResultScene, view: SurfaceView) -> list[Picture]:
    """Return residual distribution, rig, convergence and correlation."""
    calibration = scene.calibration
    solution, trace = calibration.solution, calibration.trace
    scale = trace[-1].scale_px if trace else None
    histogram = figures.histogram_figure(calibration.frames, solution.noise_px, scale)
    drawn = [
        _chart("residual distribution", histogram),
        _chart("rig from above", figures.rig_figure(calibration, view)),
    ]
    if trace:
        note = _CONVERGENCE if trace[-1].fixed_cost is not None else ""
        drawn.append(_chart("convergence", figures.convergence_figure(trace), note))
    correlation = solution.observability.get("correlation")
    if correlation:
        figure = figures.correlation_figure(correlation["unknowns"], correlation["matrix"])
        drawn.append(
            _chart("correlation", figure, wide=len(correlation["unknowns"]) > figures.NARROW)
        )
    return drawn


def frames_over_time(calibration: Calibration) -> list[Picture]:
    """Return plots of the frames' numbers, where there are many."""
    if len(calibration.solution.frames) <= FOLDED:
        return []
    return [_chart(name, figure) for name, figure in frame_charts(calibration.solution)]


def track_of(tracked: TrackedFrames | None) -> Markup:
    """Return the poses of all frames of a sequence over time, and its lost frames."""
    if tracked is None:
        return Markup("")
    lost = [row for row in tracked.rows if row.lost]
    picture = _chart("poses over the frames", track_figure(tracked))
    return render("track.html", count=len(tracked.rows), lost=lost, picture=picture)


def _chart(name: str, figure: Figure, note: str = "", wide: bool = False) -> Picture:
    width, height = figure.get_size_inches()
    inches = _WIDE_INCHES if wide else _CHART_INCHES
    figure.set_size_inches(inches, inches * height / width)
    return Picture(name, figure_svg(figure), note, wide)

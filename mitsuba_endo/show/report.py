"""``report.html``: everything about one result, or several side by side, in one offline file."""

from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path

from ..evaluate.sequence_errors import TrackedFrames
from ..files import atomic_path
from ..records.calibration import Calibration
from . import report_sections as sections
from .result_scene import ResultScene
from .truth import load_truth
from .view import SurfaceView, view_surface

REPORT = "report.html"


def save_report(
    path: str | Path,
    results: Sequence[tuple[str, Calibration]],
    views: Sequence[SurfaceView] = (),
    truths: Sequence[Path | None] = (),
    tracks: Sequence[TrackedFrames | None] = (),
) -> None:
    """Write one self-contained page: no network, no other file.

    Args:
        path: the HTML file.
        results: name and calibration of each result; several stand side by side.
        views: of the first surface of each result, where they are at hand already.
        truths: of each result, where it is synthetic.
        tracks: of each result, where its frames are keyframes of a sequence: all frames.

    Raises:
        InputError: the file cannot be written, or a truth is not that of its result.
    """
    views = views or [view_surface(c.surface, c.camera) for _, c in results]
    scenes = [ResultScene(calibration) for _, calibration in results]
    for scene, truth in zip(scenes, truths, strict=False):
        if truth is not None:
            scene.truth = load_truth(truth, scene.calibration)
    page = _page([name for name, _ in results], scenes, views, tracks or [None] * len(results))
    with atomic_path(path) as aside:
        aside.write_text(page, encoding="utf-8")


def _page(
    names: list[str],
    scenes: list[ResultScene],
    views: Sequence[SurfaceView],
    tracks: Sequence[TrackedFrames | None],
) -> str:
    several = len(scenes) > 1
    compared = ""
    if several:
        table = sections.comparison(names, [c.calibration.solution for c in scenes])
        compared = f"<h3>Compared, with 95 % intervals</h3>{table}<p></p>"
    articles = "".join(
        _article(i, *of) for i, of in enumerate(zip(names, scenes, views, tracks, strict=True))
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,">'
        f"<title>Calibration: {escape(', '.join(names))}</title><style>{_asset('report.css')}"
        f"</style></head><body{' class=many' if several else ''}>"
        f"<h1>Calibration {'results' if several else 'result'}</h1>"
        '<p class="lead">mitsuba-endo; camera frame: x right, y down, z forward; '
        "X_projector = R X_camera + t</p>"
        f'{compared}<main class="results">{articles}</main>'
        f"<script>{_asset('report.js')}</script></body></html>\n"
    )


def _article(
    number: int, name: str, scene: ResultScene, view: SurfaceView, track: TrackedFrames | None
) -> str:
    calibration, solution = scene.calibration, scene.calibration.solution
    return (
        f'<article class="result"><h2>{escape(name)}</h2>{sections.verdict(solution)}'
        f"{sections.model(solution)}{sections.track(track)}"
        f"<h3>Observed, rendered, residual</h3>{sections.viewer(calibration, number)}"
        f"<h3>Numbers</h3>{sections.number_table(solution)}{sections.charts(scene, view, number)}"
        f"<h3>Provenance</h3>{sections.provenance(solution)}</article>"
    )


def _asset(name: str) -> str:
    return resources.files("mitsuba_endo.show").joinpath(name).read_text(encoding="utf-8")

"""``report.html``: everything about one result, or several side by side, in one offline file."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from ..evaluate.tracked_frames import TrackedFrames
from ..files import atomic_path
from ..records.calibration import Calibration
from . import report_content as content
from . import report_pictures as pictures
from .result_scene import ResultScene
from .templating import asset, render
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
    solutions = [scene.calibration.solution for scene in scenes]
    articles = [
        _article(i, *of, alone=len(scenes) == 1)
        for i, of in enumerate(zip(names, scenes, views, tracks, strict=True))
    ]
    return render(
        "report.html", names=names, articles=articles, style=asset("report.css"),
        script=asset("report.js"),
        compared=content.comparison(solutions) if len(solutions) > 1 else [],
    )  # fmt: skip


def _article(
    number: int,
    name: str,
    scene: ResultScene,
    view: SurfaceView,
    track: TrackedFrames | None,
    alone: bool,
) -> Markup:
    calibration, solution = scene.calibration, scene.calibration.solution
    groups, folded = content.number_groups(solution), []
    if len(solution.frames) > content.FOLDED:
        frames = {frame.name for frame in solution.frames}
        groups, folded = (
            [g for g in groups if (g[0] in frames) == of_frames] for of_frames in (False, True)
        )
    return render(
        "result.html", name=name, alone=alone, said=content.verdict_of(solution),
        scene=pictures.scene_of(scene, view, number), maps=pictures.viewer(calibration, number),
        photographed=bool(calibration.photographs), model=model_section(calibration),
        frame_charts=pictures.frames_over_time(calibration), groups=groups, folded=folded,
        surfaces=pictures.surfaces(scene, view), charts=pictures.charts(scene, view),
        provenance=content.provenance_of(solution), track=pictures.track_of(track),
    )  # fmt: skip


def model_section(calibration: Calibration) -> Markup:
    """Return what may be wrong with the model, empty where nothing is suspected."""
    solution = calibration.solution
    return render("model.html", model=solution.model, candidates=content.candidates(solution))

"""Sections of the report as HTML; text that comes from files is escaped here."""

import json
from html import escape
from typing import Any

from matplotlib.figure import Figure

from ..evaluate.sequence_errors import TrackedFrames
from ..records.calibration import Calibration
from ..records.solution import Outcome, Solution
from . import figures
from .result_scene import ResultScene
from .solution_values import Row, rows
from .track_figure import track_figure
from .view import SurfaceView, view_surface
from .web_images import ColourBar, MapImages, MapPages, figure_image, figure_svg, map_pages
from .web_scene import scene_canvas, view_error

_CHART_INCHES = 5.2
"""Width at which the smallest label is readable in half a page."""


def verdict(solution: Solution) -> str:
    """Say what was measured, what was not, and what to be wary of."""
    settled = solution.outcome in (Outcome.CONVERGED, Outcome.TRUTH)
    outcome = solution.outcome.replace("_", " ")
    sentences = solution.verdict or ["The solution holds no verdict."]
    out = f'<p><span class="badge{"" if settled else " wary"}">{escape(outcome)}</span></p>'
    out += _list("verdict", [*sentences, given(solution)])
    notes = [
        *solution.warnings,
        *(
            f"Frame {left.name} is left out: {left.reason}"
            for left in solution.left_out
            if not any(left.name in warning for warning in solution.warnings)
        ),
    ]
    return out + (f"<h3>Warnings</h3>{_list('notes', notes)}" if notes else "")


def track(tracked: TrackedFrames | None) -> str:
    """Return the poses of all frames of a sequence over time, and its lost frames."""
    if tracked is None:
        return ""
    lost = [row for row in tracked.rows if row.lost]
    named = _list("notes", [f"{row.number}, {row.name}: {row.lost}" for row in lost])
    chart = _chart("poses over the frames", track_figure(tracked))
    return (
        f"<h3>All {len(tracked.rows)} frames</h3><p>Bands are 95 % intervals, grey frames lost "
        f'({len(lost)}). What follows is of some keyframes.</p><div class="charts">{chart}</div>'
        f"{named if lost else ''}"
    )


def model(solution: Solution) -> str:
    """List what may be wrong with the model, by how much of the residuals it explains."""
    found = solution.model
    if not found.get("suspected"):
        return ""
    lines = "".join(
        f"<tr><th>{escape(c['words'])}</th><td>{escape(_off_by(c))}</td>"
        f"<td>{100 * c['share']:.0f} %</td><td>{escape(', '.join(c['group']))}</td></tr>"
        for c in found["candidates"]
    )
    return (
        f"<h3>Model</h3><p>Structure of the residuals {found['structure']:.2f}, of noise "
        f"{found['expected']:.2f}; their correlation makes intervals {found['intervals_by']:.1f} "
        "times as wide as independent noise would.</p><table><tr><th>May be wrong</th><th>By</th>"
        f"<th>Explains</th><th>Looks like</th></tr>{lines}</table>"
    )


def _off_by(candidate: dict[str, Any]) -> str:
    """Say by how much a value is off; nothing for several together."""
    if candidate["value"] is None or candidate["std"] is None:
        return ""
    return f"{candidate['value']:+.3g} ± {candidate['std']:.2g} {candidate['unit']}"


def given(solution: Solution) -> str:
    """Say which values are input, not results."""
    projector = solution.projector
    names = {
        "focal length": projector.focal, "centre": projector.centre, "aspect": projector.aspect,
        "distortion": projector.distortion,
    }  # fmt: skip
    fixed = [f"projector {name}" for name, e in names.items() if e.status == "fixed"]
    return f"Given, not measured: {', '.join(['camera intrinsics', *fixed])}."


def _list(kind: str, sentences: list[str]) -> str:
    items = "".join(f"<li>{escape(s)}</li>" for s in sentences)
    return f'<ul class="{kind}">{items}</ul>'


def number_table(solution: Solution) -> str:
    """Return the table of values with their 95 % intervals."""
    body, group = "", None
    for row in rows(solution):
        if row.group != group:
            group = row.group
            body += f'<tr class="group"><th colspan="5">{escape(group)}</th></tr>'
        why = f'<br><span class="reason">{escape(row.reason)}</span>' if row.reason else ""
        body += (
            f'<tr class="{escape(row.status)}"><td>{escape(row.quantity)}</td>'
            f'<td class="number">{_minus(row.value)}</td><td class="number">{row.interval}</td>'
            f"<td>{escape(row.unit)}</td><td>{escape(_status(row.status))}{why}</td></tr>"
        )
    head = (
        '<tr><th>Quantity</th><th class="number">Value</th><th class="number">95 % interval</th>'
        "<th>Unit</th><th>Status</th></tr>"
    )
    return f'<div class="scroll"><table><thead>{head}</thead><tbody>{body}</tbody></table></div>'


def comparison(names: list[str], solutions: list[Solution]) -> str:
    """Set the same quantities of several solutions side by side; frames are matched by order."""
    columns = [_keyed(s) for s in solutions]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    head = "".join(f'<th class="number">{escape(n)}</th>' for n in names)
    body = ""
    for key in keys:
        cells = "".join(f'<td class="number">{_cell(c.get(key))}</td>' for c in columns)
        body += f"<tr><td>{escape(key[0])}</td><td>{escape(key[1])}</td>{cells}"
        body += f"<td>{escape(next(c[key].unit for c in columns if key in c))}</td></tr>"
    top = f"<tr><th></th><th>Quantity</th>{head}<th>Unit</th></tr>"
    return f'<div class="scroll"><table><thead>{top}</thead><tbody>{body}</tbody></table></div>'


def _keyed(solution: Solution) -> dict[tuple[str, str], Row]:
    order = {f.name: f"Frame {i + 1}" for i, f in enumerate(solution.frames)}
    return {(order.get(r.group, r.group), r.quantity): r for r in rows(solution)}


def _cell(row: Row | None) -> str:
    return "-" if row is None else f"{_minus(row.value)} {row.interval}"


def _status(status: str) -> str:
    return {"fixed": "given", "unobservable": "not determined"}.get(status, status)


def _minus(value: str) -> str:
    return escape(value.replace("-", "−") if value[:1] == "-" else value)


def viewer(calibration: Calibration, number: int) -> str:
    """Return observed, rendered and residual maps with sliders for frame and blend."""
    frames = calibration.frames
    pages = map_pages(frames)
    slider = ""
    if len(frames) > 1:
        slider = (
            f'<label>Frame <input type="range" name="frame" min="0" max="{len(frames) - 1}" '
            f'value="0" step="1"></label><output>{escape(frames[0].name)}</output>'
        )
    radios = "".join(
        f'<label><input type="radio" name="coordinate-{number}" value="{c}"'
        f"{' checked' if c == 'x' else ''}> projector {c}</label>"
        for c in "xy"
    )
    blend = (
        '<label>observed <input type="range" name="blend" min="0" max="100" value="0" '
        'aria-label="blend from observed to rendered"> rendered</label>'
    )
    panels = "".join(
        _panels(images, pages, i, coordinate, frames[i].name)
        for i, pair in enumerate(pages.images)
        for coordinate, images in enumerate(pair)
    )
    return f'<div class="viewer"><div class="controls">{slider}{radios}{blend}</div>{panels}</div>'


def _panels(images: MapImages, pages: MapPages, frame: int, coordinate: int, name: str) -> str:
    axis = "xy"[coordinate]
    hidden = "" if frame == coordinate == 0 else " hidden"
    return (
        f'<div class="panels" data-frame="{frame}" data-coordinate="{axis}" '
        f'data-name="{escape(name)}"{hidden}>'
        f'<figure><div class="stack"><img alt="observed projector {axis}" src="{images.observed}">'
        f'<img alt="rendered projector {axis}" src="{images.rendered}"></div>'
        f"{_bar(pages.coordinate_scales[coordinate])}</figure>"
        f'<figure><img class="residual" alt="residual {axis}" src="{images.residual}">'
        f"{_bar(pages.residual_scale)}</figure></div>"
    )


def _bar(scale: ColourBar) -> str:
    return (
        f'<div class="bar"><span>{_minus(scale.low)}</span><img alt="" src="{scale.image}">'
        f"<span>{_minus(scale.high)}</span></div><figcaption>{escape(scale.note)}</figcaption>"
    )


def charts(scene: ResultScene, view: SurfaceView, number: int) -> str:
    """Return surface, residual distribution, rig and convergence."""
    calibration = scene.calibration
    solution, trace = calibration.solution, calibration.trace
    scale = trace[-1].scale_px if trace else None
    known_truth = scene.truth is not None and scene.truth.surface is not None
    error = view_error(scene, 0, view) if known_truth else None
    surface = "".join(
        f'<img alt="{figure.axes[0].get_title()}" src="{figure_image(figure)}">'
        for figure in figures.surface_figures(view, scene.unit, error)
    )
    views = [view, *(view_surface(s, calibration.camera) for s in scene.surfaces[1:])]
    drawn = [
        ("residual distribution", figures.histogram_figure(
            calibration.frames, solution.noise_px, scale
        )),
        ("rig from above", figures.rig_figure(calibration, view)),
    ]  # fmt: skip
    if trace:
        drawn.append(("convergence", figures.convergence_figure(trace)))
    known = solution.observability.get("correlation")
    if known:
        drawn.append(
            ("correlation", figures.correlation_figure(known["unknowns"], known["matrix"]))
        )
    images = "".join(_chart(alt, figure) for alt, figure in drawn)
    return (
        f'<h3>Surface</h3><div class="surfaces">{surface}</div>'
        f"<h3>Surface and rig in space</h3><figure>{scene_canvas(scene, views, number)}</figure>"
        f'<h3>Residuals, rig and convergence</h3><div class="charts">{images}</div>'
    )


def _chart(name: str, figure: Figure) -> str:
    width, height = figure.get_size_inches()
    figure.set_size_inches(_CHART_INCHES, _CHART_INCHES * height / width)
    note = (
        "<figcaption>The cost is in units of the robust scale, and so jumps where that changes "
        "(dotted).</figcaption>"
        if name == "convergence"
        else ""
    )
    return f'<figure><img alt="{name}" src="{figure_svg(figure)}">{note}</figure>'


def provenance(solution: Solution) -> str:
    """Return how the result came about: versions, timings, options with the seed, the rig."""
    versions = ", ".join(f"{k} {v}" for k, v in solution.versions.items()) or "not recorded"
    seconds = ", ".join(f"{k} {v:.1f} s" for k, v in solution.timings.items()) or "not recorded"
    seed = solution.configuration.get("options", {}).get("seed", "not recorded")
    law = solution.projector.law.replace("_", " ")
    facts = "".join(
        f"<tr><th>{name}</th><td>{escape(str(text))}</td></tr>"
        for name, text in (
            ("Projection model", law), ("Seed", seed), ("Times", seconds), ("Versions", versions),
        )
    )  # fmt: skip
    details = "".join(
        f"<details><summary>{title}</summary><pre>"
        f"{escape(json.dumps(data, indent=1, ensure_ascii=False))}</pre></details>"
        for title, data in (
            ("Configuration", solution.configuration), ("Law evidence", solution.law_evidence),
        )
        if data
    )  # fmt: skip
    return f"<table>{facts}</table>{details}"

"""Surfaces, cameras, projectors and rays as data for the page's interactive view."""

import base64
import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from . import surface_colours
from .colours import CAMERA, PROJECTOR, shaded
from .frame_poses import Floats, FramePoses, camera_corners, pyramid, solution_corners
from .result_scene import ResultScene, seen_from
from .surface_colours import Shown
from .templating import render
from .view import SurfaceView, range_of

_POINTS = 18_000
"""Of one surface; of several together twice as many."""
_LARGEST = 32_000
"""Of a quantised number: within 16 bits."""
_TRUTH = "#3a3a3a"
_STEEPEST = 12.0
"""Slope against the image, beyond which neighbouring pixels see two surfaces and not one."""


@dataclass(frozen=True, eq=False)
class Paint:
    """What the surfaces can be coloured by."""

    name: str
    legend: Markup
    colours: list[str]
    """RGB of every surface's points, bytes in base 64."""


def scene_canvas(scene: ResultScene, views: list[SurfaceView], number: int = 0) -> Markup:
    """Return a canvas, with its controls, that report.js turns into a view to be turned.

    Drawn is what the cameras see of their surfaces: points in the first camera's frame, and
    quadrilaterals (Q, 4) of points that are neighbours in the image.

    Args:
        scene: the result.
        views: of every surface in its camera.
        number: of the result on its page.
    """
    if not any(np.isfinite(view.depth).any() for view in views):
        return Markup("<p>The cameras see nothing of the surfaces.</p>")
    room = _POINTS if len(views) == 1 else 2 * _POINTS // len(views)
    steps = [_step(view, room) for view in views]
    kept = [_thinned(*args) for args in zip(views, steps, strict=True)]
    paints = [*_photograph_paint(scene, kept), *_paints(scene, views, kept)]
    solution = scene.calibration.solution
    data = {
        "surfaces": [
            _surface(scene, *args) for args in zip(range(len(views)), views, steps, strict=True)
        ],
        "colours": [paint.colours for paint in paints],
        "lines": _lines(scene),
        "unit": scene.unit,
        "scaleStd": solution.scale_std_percent / 100,
    }
    names = [at.name for at in scene.poses]
    return render(
        "scene.html", data=json.dumps(data), frames=names, paints=paints, number=number,
        least=1 if len(scene.surfaces) > 1 else 0, truth=scene.truth is not None,
        unit=scene.unit, photographed=_photographed(scene),
    )  # fmt: skip


def _photographed(scene: ResultScene) -> str:
    """Return the name of the frame whose photograph lies on the surface that all share."""
    first = scene.poses[0].name
    photographs = scene.calibration.photographs
    return (
        first if len(scene.surfaces) == 1 and len(scene.poses) > 1 and first in photographs else ""
    )


def _step(view: SurfaceView, room: int) -> int:
    """Return which pixels are left out, so that about ``room`` points are drawn."""
    return max(1, math.ceil(math.sqrt(np.isfinite(view.depth).sum() / room)))


def _thinned(view: SurfaceView, step: int) -> NDArray[np.bool_]:
    """Return the pixels (H, W) of a view whose points are drawn."""
    kept = np.zeros(view.depth.shape, bool)
    kept[::step, ::step] = True
    return kept & np.isfinite(view.depth)


def _surface(scene: ResultScene, index: int, view: SurfaceView, step: int) -> dict[str, Any]:
    kept, placed = _thinned(view, step), scene.first_from_surface(index)
    points, quads = placed.apply(view.points[kept]), _quads(view.points[::step, ::step])
    out: dict[str, Any] = {
        "points": _base64(points.astype("<f4")), "quads": _base64(quads.astype("<u2")),
        "origin": placed.t.tolist(),
    }  # fmt: skip
    if view.std is None:
        return out
    shared = None if view.modes is None else view.modes[kept]
    own = view.std[kept] ** 2 - (0.0 if shared is None else np.sum(shared**2, -1))
    out["own"] = _quantised(np.sqrt(np.maximum(own, 0.0)))
    if shared is not None:
        out["modes"] = _quantised(shared)
    return out


def _quantised(values: Floats) -> dict[str, Any]:
    """Return numbers (...) as 16-bit integers and their unit; the ruler needs three digits."""
    unit = max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-12) / _LARGEST
    whole = np.round(np.nan_to_num(values) / unit).astype("<i2")
    return {"unit": unit, "data": _base64(whole)}


def _photograph_paint(scene: ResultScene, kept: list[NDArray[np.bool_]]) -> list[Paint]:
    """Return the photographs on the surfaces, where every surface's frame has one of its size."""
    images = []
    for frame, points in enumerate(kept):
        image = scene.calibration.photographs.get(scene.poses[frame].name)
        if image is None or image.shape[:2] != points.shape:
            return []
        images.append(_base64(np.ascontiguousarray(image[points])))
    return [Paint("photograph", Markup(""), images)]


def _paints(
    scene: ResultScene, views: list[SurfaceView], kept: list[NDArray[np.bool_]]
) -> list[Paint]:
    pairs = list(zip(views, kept, strict=True))
    return [
        Paint(
            q.name, Markup(q.legend()),
            [_base64(_painted(q, s, v, k)) for s, (v, k) in enumerate(pairs)],
        )
        for q in _quantities(scene, views, kept)
    ]  # fmt: skip


def _quads(points: Floats) -> NDArray[np.int64]:
    """Return quadrilaterals (Q, 4) of points (H, W, 3), NaN = not seen; those seen are counted."""
    visible = np.isfinite(points[..., 2])
    number = np.cumsum(visible).reshape(visible.shape) - 1
    rows, columns = visible.shape
    corners = [
        np.s_[i : rows - 1 + i, j : columns - 1 + j] for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    ]
    distance = np.linalg.norm(points, axis=-1)
    rays = points / distance[..., None]
    ranges = np.stack([distance[c] for c in corners])
    apart = np.linalg.norm(rays[corners[2]] - rays[corners[0]], axis=-1)
    # Where a corner is missing the comparison is false.
    kept = np.ptp(ranges, axis=0) < _STEEPEST * apart * ranges.min(0)
    return np.stack([number[c][kept] for c in corners], -1)


def _quantities(
    scene: ResultScene, views: list[SurfaceView], kept: list[NDArray[np.bool_]]
) -> list[Shown]:
    """Return what the points can be coloured by: uncertainty, error, depth."""
    pairs = list(zip(views, kept, strict=True))
    out = []
    if all(view.std is not None for view in views):
        stds = [view.std[k] for view, k in pairs if view.std is not None]
        out.append(surface_colours.uncertainty(stds, scene.unit))
    truth = scene.truth
    if truth is not None and truth.surface is not None:
        errors = [view_error(scene, s, view)[k] for s, (view, k) in enumerate(pairs)]
        out.append(surface_colours.error(errors, scene.unit, truth.alignment))
    return [*out, surface_colours.depth([view.points[k] for view, k in pairs], scene.unit)]


def view_error(scene: ResultScene, surface: int, view: SurfaceView) -> Floats:
    """Return found minus true range (H, W) along a camera's rays, NaN = unknown."""
    truth = scene.truth
    assert truth is not None
    true = range_of(seen_from(truth, surface), scene.calibration.camera)
    return np.linalg.norm(view.points, axis=-1) - true


def _painted(
    shown: Shown, surface: int, view: SurfaceView, kept: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    values, norm = shown.values[surface], Normalize(shown.low, shown.high)
    rgba = shaded(values, view.normals[kept], shown.scale, norm, relief=0.35)
    return np.round(255 * rgba[:, :3]).astype(np.uint8)


def _lines(scene: ResultScene) -> list[dict[str, Any]]:
    """Return frusta and rays: colour, kind, frame and segments."""
    out = []
    truth = scene.truth
    for k, at in enumerate(scene.poses):
        out += _frusta(scene, k, at, "frusta", (CAMERA, PROJECTOR))
        rays = scene.rays(k)
        if rays is not None:
            out.append(_line(CAMERA, "rays", k, rays.camera))
            out.append(_line(PROJECTOR, "rays", k, rays.projector))
        if truth is not None:
            out += _frusta(scene, k, truth.poses[k], "truth", (_TRUTH, _TRUTH))
    return out


def _frusta(
    scene: ResultScene, frame: int, at: FramePoses, kind: str, colours: tuple[str, str]
) -> list[dict[str, Any]]:
    solution = scene.calibration.solution
    corners = (
        camera_corners(scene.calibration.camera),
        solution_corners(solution, solution.frames[frame]),
    )
    poses = (at.first_from_camera, at.first_from_projector)
    return [
        _line(colour, kind, frame, pyramid(pose, directions, scene.reach))
        for colour, pose, directions in zip(colours, poses, corners, strict=True)
        if pose is not None
    ]


def _line(colour: str, kind: str, frame: int, segments: Floats) -> dict[str, Any]:
    rounded = np.round(segments, 6 if kind == "frusta" else 3).tolist()
    return {"colour": colour, "kind": kind, "frame": frame, "segments": rounded}


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")

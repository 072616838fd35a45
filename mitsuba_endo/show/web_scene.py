"""Surface, camera and projectors as data for the page's interactive view."""

import base64
import json
import math
from html import escape
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration
from ..records.solution import Solution
from .colours import CAMERA, DEPTH, PROJECTOR, shaded
from .figures import projector_poses, unit_name
from .view import SurfaceView

_POINTS = 12_000
_STD = "magma"
_AXIS = np.array([[0.0, 0.0, 1.0]])
_REACH = 0.4
"""Length of the drawn frusta over the surface's distance."""


def scene_canvas(calibration: Calibration, view: SurfaceView) -> str:
    """Return a canvas that report.js turns into a view to be turned with the mouse.

    Points are what the first camera sees of the surface, in its frame, coloured by standard
    deviation where known, else by depth.
    """
    seen = np.isfinite(view.depth)
    if not seen.any():
        return "<p>The camera sees nothing of the surface.</p>"
    step = max(1, math.ceil(math.sqrt(seen.sum() / _POINTS)))
    kept = np.zeros_like(seen)
    kept[::step, ::step] = True
    kept &= seen
    points = view.points[kept]
    distance = float(np.median(np.linalg.norm(points, axis=-1)))
    data = {
        "points": _base64(points.astype("<f4")),
        "colours": _base64(np.round(255 * _colours(view)[kept][:, :3]).astype(np.uint8)),
        "size": step * distance / float(calibration.camera.K[0, 0]),
        "lines": _frusta(calibration, _REACH * distance),
    }
    coloured = "standard deviation, bright is uncertain" if view.std is not None else "depth"
    return (
        f'<canvas class="scene" data-scene="{escape(json.dumps(data))}"></canvas>'
        f"<figcaption>Colour: {coloured}. Blue: camera; orange: projector; lengths in "
        f"{unit_name(calibration.solution)}. Drag to turn, wheel to zoom, double click to reset."
        "</figcaption>"
    )


def _colours(view: SurfaceView) -> NDArray[np.float64]:
    if view.std is None:
        low, high = np.nanpercentile(view.depth, [1, 99])
        return shaded(view.depth, view.normals, DEPTH, Normalize(low, max(high, low + 1e-9)))
    top = float(np.nanpercentile(view.std, 98))
    return shaded(view.std, view.normals, _STD, Normalize(0, max(top, 1e-12)))


def _frusta(calibration: Calibration, reach: float) -> list[dict[str, Any]]:
    camera, solution = calibration.camera, calibration.solution
    w, h = camera.width - 1, camera.height - 1
    corners = camera.rays(np.array([[0, 0], [w, 0], [w, h], [0, h]], float))
    lines = [_pyramid(RigidTransform.identity(), corners, reach, CAMERA)]
    directions = _pattern_corners(solution)
    return lines + [
        _pyramid(pose, directions, reach, PROJECTOR) for pose in projector_poses(solution)
    ]


def _pattern_corners(solution: Solution) -> NDArray[np.float64]:
    """Return the directions of the pattern's corners, or the axis where they are unknown.

    A wide pattern's corners may lie beyond the law's range: they are then drawn nearer to the
    middle, as far out as all four exist.
    """
    projector = solution.projector
    model, width, height = projector.to_model(), projector.width, projector.height
    if model is None or width is None or height is None:
        return _AXIS
    w, h = width - 1, height - 1
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]], float)
    middle = np.array([w / 2, h / 2])
    for share in np.arange(10, 4, -1) / 10:
        directions = model.unproject(middle + share * (corners - middle))
        if np.isfinite(directions).all():
            return directions
    return _AXIS


def _pyramid(
    first_from_own: RigidTransform, directions: NDArray[np.float64], reach: float, colour: str
) -> dict[str, Any]:
    tips = first_from_own.apply(directions * reach)
    apex = first_from_own.t
    segments = [[apex, tip] for tip in tips]
    segments += [[a, b] for a, b in zip(tips, np.roll(tips, -1, axis=0), strict=True)]
    return {"colour": colour, "segments": np.round(np.array(segments), 6).tolist()}


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(array.tobytes()).decode("ascii")

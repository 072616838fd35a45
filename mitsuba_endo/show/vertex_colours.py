"""The colour of a sequence's surface, from the photographs of some keyframes."""

import numpy as np
from numpy.typing import NDArray

from ..evaluate.depth import RayCaster
from ..records.trajectory import FrameRow
from ..sequence.outcome import SequenceResult

Floats = NDArray[np.float64]

UNSEEN = 128
"""Grey of what no photograph shows."""
HIDDEN = 0.02
"""Of the range: a vertex that lies farther behind what its ray meets first is hidden. Chosen: a
voxel is a hundredth of it."""


def vertex_colours(result: SequenceResult, part: int) -> NDArray[np.uint8] | None:
    """Return the colours (V, 3), RGB, of the vertices of a part; None without photographs.

    Each is the mean over the photographs that show the vertex, near ones with more weight. The
    pattern and the fall of the light are in them.
    """
    surface = result.surfaces[part]
    rows = [result.rows[k] for k in sorted(result.pictures) if result.rows[k].part == part]
    if surface is None or not rows:
        return None
    caster = RayCaster(surface.vertices, surface.faces)
    sums, weights = np.zeros((len(surface.vertices), 3)), np.zeros(len(surface.vertices))
    for row in rows:
        which, pixels, distance = _shown(surface.vertices, row, result, caster)
        weight = distance**-2.0
        colours = result.pictures[row.number][pixels[:, 1], pixels[:, 0]]
        sums[which] += weight[:, None] * colours
        weights[which] += weight
    coloured = weights > 0
    mean = sums / np.where(coloured, weights, 1.0)[:, None]
    return np.where(coloured[:, None], np.round(mean), UNSEEN).astype(np.uint8)


def _shown(
    vertices: Floats, row: FrameRow, result: SequenceResult, caster: RayCaster
) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats]:
    """Return which vertices (N,) a frame shows, at which pixels (N, 2), how far away (N,)."""
    pose, camera = row.world_from_camera, result.rig.camera.to_model()
    assert pose is not None
    at = pose.inverse().apply(vertices)
    with np.errstate(all="ignore"):
        pixels = np.round(camera.project(at))
        inside = ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(1)
    which = np.flatnonzero(inside & (at[:, 2] > 0))
    distance = np.linalg.norm(at[which], axis=1)
    met = caster.range(pose.t, (vertices[which] - pose.t) / distance[:, None])
    open_ = np.isnan(met) | (met > (1 - HIDDEN) * distance)
    which = which[open_]
    return which, pixels[which].astype(np.int64), distance[open_]

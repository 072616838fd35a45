"""Where each cell looks, by a known geometry: its ray leaves one unknown, the distance.

Every cell's ray is followed through inverse ranges around those of the surface that is known. The
coordinates that it would have there are points of its epipolar line, and the pattern around them is
compared with the image: plane-sweep stereo (Collins, A Space-Sweep Approach to True Multi-Image
Matching, 1996) with a projector, along a surface instead of planes.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from .cells import SIDE, Image, mean, middles, padded
from .image_view import ImageView
from .iterate import DARK
from .pattern_image import PatternImage
from .semi_global_matching import aggregated

HYPOTHESES = 64
"""Inverse ranges tried; neighbours are 3 % apart, one or two pattern pixels on the line."""
NEAREST, FARTHEST = 2.2, 0.25
"""Largest and least inverse range over that of the surface nearby: beyond a fold it changes so."""
NEIGHBOUR, JUMP = 0.05, 1.0
"""Costs of a step in depth from one cell to the next, in correlations: a small one is a slant, a
large one a fold."""
APART = 5.0
"""Pattern pixels from which another place of the line is another match."""
SPREADS = (1, 2, 4, 8, 16, 32)
"""Standard deviations, cells, under which known inverse ranges are averaged to fill missing ones:
the first that holds enough of them counts."""
HELD = 0.05
"""Share of a window that is enough."""


@dataclass(frozen=True, eq=False)
class KnownGeometry:
    """What a calibration says of one frame; lengths in any one unit."""

    camera: CameraModel
    projector: ProjectorModel
    projector_from_camera: RigidTransform
    range: NDArray[np.floating]
    """(H, W) distance along each pixel's ray, NaN = not known."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """The best place of every cell on its epipolar line; arrays (h, w) or (h, w, 2)."""

    q: Image
    """Pattern pixels."""
    along: Image
    """Unit vector of the epipolar line there, in the pattern."""
    margin: Image
    """By how much the aggregated correlation exceeds that of the best other match."""


def sweep(
    geometry: KnownGeometry, view: ImageView, pattern: PatternImage, blur: float, sigma: float
) -> Sweep:
    """Match every cell along its epipolar line.

    Args:
        geometry: known, with at least one range.
        view: of the image.
        pattern: that was projected.
        blur: of the pattern, pattern pixels.
        sigma: standard deviation of the windows of comparison, camera pixels.
    """
    coordinates = _coordinates(geometry, view.light.shape)
    correlation = _correlations(coordinates, view, pattern, blur, sigma)
    cost = aggregated(1 - correlation, NEIGHBOUR, JUMP)
    best = cost.argmin(-1)[..., None]
    q = np.take_along_axis(coordinates, best[..., None], 2)[:, :, 0]
    other = np.linalg.norm(coordinates - q[:, :, None], axis=-1) > APART
    rival = np.where(other, cost, np.inf).min(-1)
    margin = rival - np.take_along_axis(cost, best, -1)[..., 0]
    last = coordinates.shape[2] - 1
    ends = [np.take_along_axis(coordinates, np.clip(best + k, 0, last)[..., None], 2)[:, :, 0]
            for k in (1, -1)]  # fmt: skip
    along = ends[0] - ends[1]
    along = along / np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    held = pattern.holds(q) & np.isfinite(q).all(-1)
    return Sweep(q, along.astype(np.float32), np.where(held, margin, -1).astype(np.float32))


def _coordinates(geometry: KnownGeometry, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return coordinates (h, w, K, 2) of the cells' middles at all inverse ranges."""
    x, y = (np.arange(SIDE // 2, n, SIDE, dtype=float) for n in (shape[1], shape[0]))
    rays = geometry.camera.rays(np.stack(np.meshgrid(x, y), -1))
    near = middles(padded(1 / geometry.range.astype(float), np.nan))
    around = _filled(near)[..., None] * np.geomspace(FARTHEST, NEAREST, HYPOTHESES)
    points = geometry.projector_from_camera.apply(rays[:, :, None] / around[..., None])
    return geometry.projector.project(points).astype(np.float32)


def _filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values (h, w) with the missing ones from wider and wider averages of those known."""
    finite = np.isfinite(values)
    out = np.full(values.shape, values[finite].mean())
    todo = np.ones(values.shape, bool)
    sums = [np.where(finite, values, 0), finite.astype(float)]
    for spread in SPREADS:
        total, weight = (np.asarray(cv2.GaussianBlur(f, (0, 0), spread,
                                                     borderType=cv2.BORDER_CONSTANT))
                         for f in sums)  # fmt: skip
        now = todo & (weight > HELD)
        out[now] = total[now] / weight[now]
        todo &= ~now
    return out


def _correlations(
    coordinates: NDArray[np.float32],
    view: ImageView,
    pattern: PatternImage,
    blur: float,
    sigma: float,
) -> NDArray[np.float32]:
    """Return zero-mean normalised correlations (h, w, K); -1 off the pattern."""
    even = np.asarray(cv2.GaussianBlur(np.maximum(view.light, 0), (0, 0), sigma))
    weight = view.clear.astype(np.float32) / (DARK + even) ** 2
    lit = weight * view.light
    w, s, ss = (_window(f, sigma) for f in (weight, lit, lit * view.light))
    n = np.maximum(w, 1e-9)
    size = view.light.shape[::-1]
    out = np.empty(coordinates.shape[:3], np.float32)
    for k in range(coordinates.shape[2]):
        middles = np.ascontiguousarray(coordinates[:, :, k])
        q = np.asarray(
            cv2.resize(np.nan_to_num(middles), size, interpolation=cv2.INTER_LINEAR), np.float32
        )
        value = pattern.brightness(q, blur)
        t, tt, both = (_window(f, sigma) for f in (weight * value, weight * value**2, lit * value))
        power = (ss - s * s / n) * (tt - t * t / n)
        correlation = (both - s * t / n) / np.sqrt(np.maximum(power, 1e-9 * n * n))
        out[:, :, k] = np.where(pattern.holds(middles), correlation, -1)
    return out


def _window(field: Image, sigma: float) -> NDArray[np.float32]:
    wide = cv2.GaussianBlur(mean(field), (0, 0), sigma / SIDE, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(wide, np.float32)

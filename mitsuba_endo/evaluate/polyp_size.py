"""Size of a polyp on a measured surface, with its interval.

A sessile polyp is modelled as a ball that stands out of a bent wall, with a rounded foot. With the
signed heights over the wall, a, and over the ball, b = |x - c| - R, both positive in the lumen,
the surface is the zero set of the rounded union

    g = max(r, min(a, b)) - |(max(r - a, 0), max(r - b, 0))|,

r the foot's radius. The wall is the plane through the base, bent by a quadratic form, so that it
may be a tube's. The diameter is that of the circle in which the ball meets the base plane,
2 sqrt(R^2 - h^2) with h the centre's height over it: what stands on the wall, also where the polyp
is lower than half a ball. Hidden sides need no points, since the ball is one; that a polyp may be
none is told by the jackknife.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.transforms import tangent_basis
from ..records.calibration import SurfaceEstimate
from ..robust import robust_std

Floats = NDArray[np.float64]

REGION = 1.3
"""Radius of the part of the image that is fitted, outlines: beyond it the wall goes its own way."""
SECTORS = 8
"""Of the region about the polyp's middle, one of which is left out at a time."""
_FEWEST = 30
"""Vertices in the outline and in the ring around it below which no size is told."""
_FOOT = (0.0, 0.4)
"""Radius of the rounded foot, ball radii."""
_MOST = 600
"""Vertices that are fitted, spread evenly where there are more."""
_BEND = 0.05
"""Spread of the wall's bends, over the ball's radius: a polyp stands on little of a tube."""
_LEAST_HEIGHT = 3.0
"""Standard deviations of a vertex by which a polyp stands out of the wall."""
_SIZES = (0.6, 1.0, 1.6)
"""Of the balls from which the fit starts, relative to the one that fills the outline."""
_OFF_WALL = 2.5
"""Robust standard deviations from the wall's plane at which a point is none of it. Chosen."""
_CAP = 0.7
"""Share of a polyp's height from which on its points tell where its middle is. Chosen."""


@dataclass(frozen=True)
class PolypSize:
    """What was measured, in the surface's unit."""

    diameter: float
    """Of the base circle."""
    height: float
    """Of the top over the base."""
    std: float
    """Standard deviation of the diameter, all of the three below."""
    interval: tuple[float, float]
    """95 % interval of the diameter."""
    std_points: float
    """From the points' own noise, and from a polyp that is no ball: jackknife over sectors."""
    std_calibration: float
    """From what the surface's errors have in common."""
    std_unit: float
    """From the unit of length."""


@dataclass(frozen=True, eq=False)
class _Patch:
    """The region around a polyp in a frame of its own: the wall about z = 0, the lumen above."""

    points: Floats
    """(N, 3)"""
    rays: Floats
    """(N, 3) along which the points err."""
    modes: Floats
    """(N, K) see :attr:`SurfaceEstimate.modes`."""
    noise: Floats
    """(N,) standard deviation that weighs the points."""
    inside: NDArray[np.bool_]
    """(N,) in the outline."""


def measure_polyp(
    surface: SurfaceEstimate,
    camera: CameraModel,
    middle: ArrayLike,
    outline: float,
    scale_std_percent: float = 0.0,
) -> PolypSize:
    """Measure the polyp inside a circle that was drawn around it in the first camera's image.

    The circle need not be exact: it says where the ball is looked for first.

    Args:
        surface: in the camera's frame, along whose rays its vertices err.
        camera: the one in whose image the circle is.
        middle: (2,) of the circle, camera pixels.
        outline: radius of the circle, camera pixels.
        scale_std_percent: standard deviation of the surface's unit
            (:attr:`Solution.scale_std_percent`).

    Raises:
        InputError: too little surface in or around the circle, or nothing like a polyp there.
    """
    patch = _patch(surface, camera, np.asarray(middle, np.float64), outline)
    every = np.ones(len(patch.points), bool)
    fits = [_fit(patch, start, every) for start in _starts(patch)]
    parameters = min(fits, key=lambda p: _cost(patch, p))
    size, height = _size(parameters), parameters[0] + _above(parameters)
    if not (np.isfinite(size) and height > _LEAST_HEIGHT * np.median(patch.noise)):
        raise InputError("nothing in the circle stands out of the wall", "outline")
    sectors = _sectors(patch, parameters)
    left_out = np.array([_size(_fit(patch, parameters, sectors != k)) for k in np.unique(sectors)])
    n = len(left_out)
    points = float(np.sqrt((n - 1) / n * np.sum((left_out - np.mean(left_out)) ** 2)))
    shifts = [_size(_fit(patch, parameters, every, mode)) - size for mode in patch.modes.T]
    calibration, unit = float(np.linalg.norm(shifts)), size * scale_std_percent / 100
    std = float(np.sqrt(points**2 + calibration**2 + unit**2))
    # Welch and Satterthwaite: the jackknife's part is known from few sectors alone.
    freedom = (n - 1) * (std / max(points, 1e-9 * std)) ** 4 if std else 1.0
    half = float(student.ppf(0.975, freedom)) * std
    return PolypSize(
        size, float(height), std, (size - half, size + half), points, calibration, unit
    )


def _patch(surface: SurfaceEstimate, camera: CameraModel, middle: Floats, outline: float) -> _Patch:
    """Cut out the region and turn it so that the wall is about z = 0."""
    at = camera.project(surface.vertices)
    away = np.linalg.norm(at - middle, axis=1) / outline
    # What covers the polyp in part, or shows behind it, is in the circle but not near.
    distance = np.linalg.norm(surface.vertices, axis=1)
    middle_distance = np.median(distance[away < 0.5]) if (away < 0.5).any() else np.nan
    reach = REGION * outline / camera.K[0, 0] * middle_distance
    near = np.flatnonzero((away < REGION) & (np.abs(distance - middle_distance) < reach))
    inside = away[near] < 1
    if min(inside.sum(), (~inside).sum()) < _FEWEST:
        raise InputError(
            f"there are {inside.sum()} vertices in the circle and {(~inside).sum()} around it",
            "outline", f"draw a circle on the surface; {_FEWEST} of either are needed",
        )  # fmt: skip
    step = -(-len(near) // _MOST)
    near, inside = near[::step], inside[::step]
    points = surface.vertices[near]
    rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    modes = np.zeros((len(near), 0)) if surface.modes is None else surface.modes[near]
    std = np.ones(len(near)) if surface.std is None else surface.std[near]
    own = np.sqrt(np.maximum(std**2 - np.sum(modes**2, -1), (0.1 * std) ** 2))
    normal, foot = _wall(points[~inside], rays[~inside])
    R = np.column_stack([tangent_basis(normal), normal]).T
    R[0] *= np.sign(np.linalg.det(R))
    return _Patch((points - foot) @ R.T, rays @ R.T, modes, own, inside)


def _wall(points: Floats, rays: Floats) -> tuple[Floats, Floats]:
    """Return normal and a point of the plane of most points, by trimming what is far from it."""
    kept = np.ones(len(points), bool)
    normal, middle = np.zeros(3), np.zeros(3)
    for _ in range(10):
        middle = points[kept].mean(0)
        normal = np.linalg.svd(points[kept] - middle, full_matrices=False)[2][-1]
        off = np.abs((points - middle) @ normal)
        kept = off <= _OFF_WALL * robust_std(off)
    return -normal * np.sign(np.mean(rays @ normal)), middle


def _starts(patch: _Patch) -> list[Floats]:
    """Return balls on the highest part of the outline: (R, x, y, z), wall (6), foot."""
    ball = patch.points[patch.inside]
    top = float(np.quantile(ball[:, 2], 0.98))
    x, y = np.median(ball[ball[:, 2] >= _CAP * top][:, :2], axis=0)
    reach = float(np.quantile(np.hypot(ball[:, 0] - x, ball[:, 1] - y), 0.8))
    return [np.array([s * reach, x, y, top - s * reach, 0, 0, 0, 0, 0, 0, 0.1]) for s in _SIZES]


def _fit(
    patch: _Patch, start: Floats, used: NDArray[np.bool_], shift: Floats | None = None
) -> Floats:
    """Fit the model to some of the points, moved along their rays by ``shift`` (N,)."""
    points = patch.points if shift is None else patch.points + shift[:, None] * patch.rays
    points, noise = points[used], patch.noise[used]
    length = start[0]
    scale = np.array([*np.full(5, length), 1, 1, *np.full(3, 1 / length), 1]) * 0.1
    low, high = np.full(11, -np.inf), np.full(11, np.inf)
    low[0], (low[10], high[10]) = 0.1 * length, _FOOT
    optimum = least_squares(
        lambda p: _residuals(p, points, noise), np.clip(start, low + 1e-9, high - 1e-9),
        loss="cauchy", f_scale=1.5, x_scale=scale, bounds=(low, high), max_nfev=80,
        xtol=1e-5, ftol=1e-6,
    )  # fmt: skip
    return optimum.x


def _residuals(p: Floats, points: Floats, noise: Floats) -> Floats:
    return np.concatenate([_height(p, points) / noise, p[7:10] * p[0] / _BEND])


def _cost(patch: _Patch, p: Floats) -> float:
    return float(np.log1p((_residuals(p, patch.points, patch.noise) / 1.5) ** 2).sum())


def _height(p: Floats, points: Floats) -> Floats:
    """Return g (N,) at the points for p = (R, c, wall height, slopes, bends, foot / R)."""
    radius, centre, foot = p[0], p[1:4], p[10] * p[0]
    x, y = points[:, 0] - centre[0], points[:, 1] - centre[1]
    bent = p[4] + p[5] * x + p[6] * y + p[7] * x * x + p[8] * x * y + p[9] * y * y
    over = (points[:, 2] - bent) / np.sqrt(1 + p[5] ** 2 + p[6] ** 2)
    off = np.linalg.norm(points - centre, axis=1) - radius
    corner = np.hypot(np.maximum(foot - over, 0), np.maximum(foot - off, 0))
    return np.maximum(foot, np.minimum(over, off)) - corner


def _above(p: Floats) -> float:
    """Return the height of the ball's centre over the base plane."""
    return float((p[3] - p[4]) / np.sqrt(1 + p[5] ** 2 + p[6] ** 2))


def _size(p: Floats) -> float:
    """Return the diameter of the circle in which ball and base plane meet; NaN if they do not."""
    # A centre above the wall: the widest part of the polyp counts, which is the ball's.
    below = min(_above(p), 0.0)
    return 2 * float(np.sqrt(p[0] ** 2 - below**2)) if p[0] > -below else float("nan")


def _sectors(patch: _Patch, p: Floats) -> NDArray[np.int64]:
    x, y = (patch.points[:, :2] - p[1:3]).T
    return np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * SECTORS).astype(np.int64) % SECTORS

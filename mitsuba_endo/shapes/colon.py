"""A segment of colon seen from inside, with optional polyps of known size."""

from dataclasses import dataclass as plain_dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.dataclasses import dataclass

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.centre_line import CentreLine
from mitsuba_endo.shapes.grid import check_size, grid_faces
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.noise import random_waves
from mitsuba_endo.shapes.polyp import Polyp, PolypTruth, raise_polyp, wrap_angle
from mitsuba_endo.shapes.registry import CHECKED, Finite, NonNegative, Positive, Seed, register

Array = NDArray[np.float64]

TENIAE = 3
"""Bands of muscle along a colon (anatomy)."""
POLYP_REFINEMENT = 2.5
"""How much closer vertices lie at a polyp than elsewhere."""
ALONG = 0.7
"""Cells are shorter along the tube and longer around it: folds are curved along it."""
OPEN = 0.8
"""Share of the radius that folds may fill, and of the axis' radius of curvature that a tube may."""


@plain_dataclass(frozen=True, eq=False)
class _Folds:
    """The folds of one segment, one row a fold."""

    along: Array
    """(K,) position of the crest on the centre line, mm."""

    angle: Array
    """(K,) angle of the crest's middle, rad."""

    depth: Array
    """(K,) depth in the middle, mm."""

    skew: Array
    """(K,) displacement of the crest along the tube per radian, mm."""


@register("colon")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class Colon:
    """A tube around the camera that runs along +z and then bends away.

    Three bands (teniae) divide the wall lengthwise. Between two of them crescent folds rise
    towards the centre line, staggered from one third to the next, and the wall bulges outward
    between the folds. Positions on the wall are (along, angle): mm along the centre line from
    the camera, and rad about it from +x towards +y.

    u rises and falls once around the tube, so that a texture has no seam; v runs along it.
    """

    length: Annotated[float, Field(gt=10, allow_inf_nan=False)] = 170.0
    """Length of the centre line before the camera, mm."""

    behind: Positive = 15.0
    """Length of the tube behind the camera, mm."""

    radius: Positive = 24.0
    """Radius of the wall before folds and bands rise from it, mm."""

    bend: Annotated[float, Field(ge=0, le=1.3, allow_inf_nan=False)] = 0.75
    """Angle by which the centre line has turned at its end, rad."""

    bend_towards: Finite = 0.6
    """Side to which it turns, as an angle from +x towards +y, rad."""

    fold_depth: NonNegative = 8.5
    """Depth of the deepest fold, mm. Others are between 0.7 of it and all of it."""

    fold_spacing: Positive = 22.0
    """Mean distance of the folds of one third of the wall, mm."""

    fold_width: Positive = 3.6
    """Half-thickness of a fold's ridge, mm."""

    tenia_depth: NonNegative = 2.0
    """Height of the three bands over the wall, mm."""

    roughness: NonNegative = 0.1
    """Root mean square of the fine relief, mm."""

    closed_end: bool = True
    """Close the far end with a dome, so that every camera ray meets the wall."""

    polyps: tuple[Polyp, ...] = ()
    """Polyps to raise from the wall."""

    edge: Positive = 1.06
    """Mean length of a grid cell's side, mm. The default gives about 60,000 triangles; the cells
    under a polyp are 2.5 times finer."""

    seed: Seed = 0
    """Chooses the folds' places, depths and directions and the relief."""

    def __post_init__(self) -> None:
        rises = self.fold_depth + self.tenia_depth + 4 * self.roughness
        if rises > OPEN * self.radius:
            raise InputError(
                f"folds of {rises:.3g} mm nearly close a tube of radius {self.radius:g} mm",
                where="colon: fold_depth",
                todo="keep fold_depth + tenia_depth below 0.8 radius",
            )
        if self._line().sharpest * self.radius > OPEN:
            raise InputError(
                f"a tube of radius {self.radius:g} mm cannot turn by {self.bend:g} rad "
                f"in {self.length:g} mm",
                where="colon: bend",
                todo="reduce bend, or lengthen the segment",
            )
        for number, polyp in enumerate(self.polyps):
            if not -self.behind < polyp.along < self.length:
                raise InputError(
                    f"{polyp.along:g} mm is outside the segment",
                    where=f"colon: polyps.{number}.along",
                    todo=f"choose between {-self.behind:g} and {self.length:g}",
                )

    def mesh(self) -> Mesh:
        """Build the tube, polyps included."""
        check_size(2 * self._end() * 2 * np.pi * self.radius / self.edge**2, "colon")
        along, angle = np.meshgrid(*self._samples(), indexing="ij")
        points = self.wall(along, angle)
        for polyp, truth in zip(self.polyps, self.polyp_truth(), strict=True):
            points = raise_polyp(points, along, angle, polyp, truth)
        rows, columns = along.shape
        vertices, faces = points.reshape(-1, 3), grid_faces(rows, columns, wrap=True)
        uv = np.stack([1 - np.abs(1 - angle / np.pi), (along + self.behind) / self._end()], -1)
        uv = uv.reshape(-1, 2)
        if self.closed_end:
            pole = self.wall(np.array(self._end() - self.behind), np.array(0.0))
            last = np.arange((rows - 1) * columns, rows * columns)
            fan = np.stack([last, np.full(columns, rows * columns), np.roll(last, -1)], axis=1)
            vertices, faces = np.vstack([vertices, pole]), np.concatenate([faces, fan])
            uv = np.vstack([uv, [0.5, 1.0]])
        return Mesh(vertices, faces, np.clip(uv, 0, 1))

    def polyp_truth(self) -> tuple[PolypTruth, ...]:
        """Return where each polyp is, in the camera frame, in the order of `polyps`."""
        return tuple(polyp.stand_on(self.wall) for polyp in self.polyps)

    def wall(self, along: Array, angle: Array) -> Array:
        """Return points (..., 3) of the wall without polyps, mm.

        Past `length` the dome begins: `along` is then length + radius * (angle on the dome), and
        reaches the far pole at a quarter turn.
        """
        turn = np.clip((along - self.length) / self.radius, 0, np.pi / 2)
        on_line = np.minimum(along, self.length) + self.radius * np.sin(turn)
        # Folds are placed by `along`, which keeps them evenly spaced on the dome too.
        distance = (self.radius - self._rise(along, angle)) * np.cos(turn)
        centre, first, second = self._line().frame(on_line)
        outward = np.cos(angle)[..., None] * first + np.sin(angle)[..., None] * second
        return centre + distance[..., None] * outward

    def _rise(self, along: Array, angle: Array) -> Array:
        """Return how far the wall stands in from `radius` at (along, angle), mm."""
        rng = np.random.default_rng(self.seed)
        turned = rng.uniform(0, 2 * np.pi / TENIAE)
        folds = self._folds(rng, turned)
        rough_at = np.stack(
            [self.radius * np.cos(angle), self.radius * np.sin(angle), along], axis=-1
        )
        # Crests waver a little, as soft tissue does.
        along = along + 1.5 * random_waves(rough_at, 35.0, rng)
        rise = self.roughness * random_waves(rough_at, 9.0, rng)
        # exp(k (cos x - 1)) is the periodic bell of standard deviation 1 / sqrt(k).
        band = np.exp(4 * (np.cos(TENIAE * (angle - turned)) - 1))
        rise = rise + self.tenia_depth * band
        crest = np.zeros_like(rise)
        for s, middle, depth, skew in zip(
            folds.along, folds.angle, folds.depth, folds.skew, strict=True
        ):
            around = wrap_angle(angle - middle)
            off = along - s - skew * around
            # A thin ridge on a broad foot: the wall between two feet is the haustrum's bulge.
            ridge = 0.62 / np.cosh(np.clip(off / self.fold_width, -30, 30)) ** 2
            foot = 0.38 * np.exp(-((off / (0.3 * self.fold_spacing)) ** 2))
            crescent = np.exp(-((around / 0.95) ** 4))
            # The p-norm joins neighbouring folds without adding their depths.
            crest = crest + (depth * crescent * (ridge + foot)) ** 4
        return rise + crest**0.25

    def _folds(self, rng: np.random.Generator, turned: float) -> _Folds:
        """Place the folds: one row per third of the wall, staggered by a third of the spacing."""
        first = -self.behind - self.fold_spacing
        count = int(np.ceil((self._end() + 2 * self.fold_spacing) / self.fold_spacing))
        row, number = np.meshgrid(np.arange(TENIAE), np.arange(count), indexing="ij")
        jitter = rng.uniform(-0.18, 0.18, row.shape)
        along = first + self.fold_spacing * (number + row / TENIAE + jitter)
        angle = turned + 2 * np.pi / TENIAE * (row + 0.5) + rng.uniform(-0.12, 0.12, row.shape)
        depth = self.fold_depth * rng.uniform(0.7, 1.0, row.shape)
        skew = rng.uniform(-4.0, 4.0, row.shape)
        return _Folds(along.ravel(), angle.ravel(), depth.ravel(), skew.ravel())

    def _samples(self) -> tuple[Array, Array]:
        """Return grid positions along (R,) and angle (C,), finer where polyps are."""
        stop = self._end() - self.behind - (self.edge if self.closed_end else 0.0)
        reach = [0.8 * polyp.diameter for polyp in self.polyps]
        along = _graded(
            -self.behind, stop, ALONG * self.edge, [p.along for p in self.polyps], reach, wrap=False
        )
        turns = [p.angle * self.radius for p in self.polyps]
        around = _graded(0.0, 2 * np.pi * self.radius, self.edge / ALONG, turns, reach, wrap=True)
        return along, around[:-1] / self.radius

    def _end(self) -> float:
        """Length of the whole surface line from the near opening to the far end, mm."""
        dome = np.pi / 2 * self.radius if self.closed_end else 0.0
        return self.behind + self.length + dome

    def _line(self) -> CentreLine:
        reach = self.length + self.radius
        return _centre_line(-self.behind, self.length, reach, self.bend, self.bend_towards)


@lru_cache(maxsize=4)
def _centre_line(*parameters: float) -> CentreLine:
    """Keep the line: it integrates its path once, and points are asked of it many times."""
    return CentreLine(*parameters)


def _graded(
    low: float, high: float, step: float, centres: list[float], reach: list[float], *, wrap: bool
) -> Array:
    """Return increasing samples from low to high, `step` apart and finer around `centres`, mm."""
    fine = np.linspace(low, high, max(64, 8 * int((high - low) / step)))
    density = np.full_like(fine, 1 / step)
    for centre, width in zip(centres, reach, strict=True):
        off = fine - centre
        if wrap:
            off = wrap_angle(off * 2 * np.pi / (high - low)) * (high - low) / (2 * np.pi)
        bell = np.exp(-((off / width) ** 4))
        density = np.maximum(density, (1 + (POLYP_REFINEMENT - 1) * bell) / step)
    total = np.concatenate([[0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    count = max(8, round(total[-1]))
    return np.interp(np.linspace(0, total[-1], count + 1), total, fine)

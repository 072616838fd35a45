"""The coded grid of the endoscope's DOE, as brightness, texture and exact truth."""

from dataclasses import dataclass as record
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from .gap_code import gap_code

COLOURS = {"green": (0.05, 1.0, 0.12), "white": (1.0, 1.0, 1.0)}
TEXELS_PER_SIGMA = 1.0
"""Coarser textures average several samples a texel, so that thin lines do not alias."""
_STRIP = 64
"""Rows of a texture made at a time: memory that is used again, which is twice as fast."""


@record(frozen=True, eq=False)
class GridTruth:
    """What the pattern means at given places; NaN, -1 and 0 outside the grid's nodes."""

    lattice: NDArray[np.float64]
    """(..., 2) column and row, continuous; whole numbers are nodes."""
    phase: NDArray[np.float64]
    """(..., 2) radians in [-pi, pi), zero on the vertical and the level horizontal lines."""
    node: NDArray[np.int32]
    """(..., 2) column and row of the nearest node."""
    code: NDArray[np.int8]
    """(...) its code: 1 = R (right part of the line higher), 0 = S (level), -1 = L."""


@dataclass(frozen=True, kw_only=True, config=ConfigDict(extra="forbid"))
class CodedGrid:
    """Continuous vertical lines, and horizontal lines that step at each crossing by its code.

    Between the nodes (i, j) and (i, j + 1) the horizontal line runs straight from
    step/2 code(i, j) above the row to step/2 code(i, j + 1) below it, so lines never drift and
    nodes sit at their exact places. The grid is centred in the pattern.
    """

    width: Annotated[int, Field(ge=2, le=8192)] = 480
    """Pattern pixels."""
    height: Annotated[int, Field(ge=2, le=8192)] = 384
    columns: Annotated[int, Field(ge=3, le=256)] = 32
    """Vertical lines."""
    rows: Annotated[int, Field(ge=3, le=256)] = 32
    """Horizontal lines."""
    period: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 12.0
    """Distance of the lines, pattern pixels."""
    line: Annotated[float, Field(gt=0, lt=0.25)] = 0.06
    """Standard deviation of a line's Gaussian profile, in periods."""
    step: Annotated[float, Field(gt=0, lt=0.5)] = 0.28
    """Height of a step, in periods; less than 0.2 gets lost, more than 0.4 disturbs the phase."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Of the code."""
    background: Annotated[float, Field(ge=0, lt=1)] = 0.02
    """Light between the lines relative to them: the DOE's stray light."""
    zero_order: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    """Brightness of the undiffracted beam in the middle, relative to the lines."""
    zero_order_size: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2.0
    """Standard deviation of that spot, pattern pixels."""
    oversample: Annotated[int, Field(ge=1, le=8)] = 2
    """Texels per pattern pixel along each axis."""
    colour: Literal["green", "white"] = "green"

    @property
    def code(self) -> NDArray[np.int8]:
        """(rows, columns) codes of -1, 0 and 1.

        Raises:
            InputError: no code of that size was found.
        """
        return gap_code(self.rows, self.columns, self.seed)

    @property
    def nodes(self) -> NDArray[np.float64]:
        """(rows, columns, 2) pattern pixels of the nodes."""
        return self.pixels(np.stack(np.meshgrid(np.arange(self.columns), np.arange(self.rows)), -1))

    def pixels(self, lattice: NDArray[np.floating] | NDArray[np.integer]) -> NDArray[np.float64]:
        """Return the pattern pixels (..., 2) of continuous columns and rows (..., 2)."""
        return (lattice - self._middle) * self.period + self._centre

    def truth(self, q: NDArray[np.floating]) -> GridTruth:
        """Return what the pattern means at ``q`` (..., 2), pattern pixels (x, y)."""
        lattice = self._lattice(q)
        nearest = np.round(lattice)
        inside = np.all((nearest >= 0) & (nearest < [self.columns, self.rows]), axis=-1)
        missing = ~np.asarray(inside)[..., None]
        node = np.where(missing, -1, nearest).astype(np.int32)
        phase = 2 * np.pi * (np.mod(lattice + 0.5, 1) - 0.5)
        return GridTruth(
            lattice=np.where(missing, np.nan, lattice),
            phase=np.where(missing, np.nan, phase),
            node=node,
            code=np.where(inside, self.code[node[..., 1], node[..., 0]], 0).astype(np.int8),
        )

    def brightness(self, q: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the light (...) at ``q`` (..., 2), pattern pixels; a line's middle is 1."""
        q = np.asarray(q, np.float64)
        return self._light(q[..., 0], q[..., 1])

    def texture(self, width: int, height: int) -> NDArray[np.float32]:
        """Return the brightness of the whole pattern on ``height`` x ``width`` texels."""
        finest = TEXELS_PER_SIGMA / (self.line * self.period)
        repeat = [max(1, int(np.ceil(finest * p / n)))
                  for p, n in ((self.width, width), (self.height, height))]  # fmt: skip
        x = _texels(self.width, width * repeat[0])
        y = _texels(self.height, height * repeat[1])
        strips = np.array_split(y, np.ceil(len(y) / _STRIP))
        light = np.concatenate([self._light(x, strip[:, None]) for strip in strips])
        blocks = light.reshape(height, repeat[1], width, repeat[0])
        return blocks.mean((1, 3)).astype(np.float32)

    def image(self) -> NDArray[np.float32]:
        """Return the linear RGB image (height oversample, width oversample, 3).

        Raises:
            InputError: no code of that size was found.
        """
        bright = self.texture(self.width * self.oversample, self.height * self.oversample)
        return bright[..., None] * np.array(COLOURS[self.colour], np.float32)

    @property
    def _centre(self) -> NDArray[np.float64]:
        return (np.array([self.width, self.height]) - 1) / 2

    @property
    def _middle(self) -> NDArray[np.float64]:
        return (np.array([self.columns, self.rows]) - 1) / 2

    def _lattice(self, q: NDArray[np.floating]) -> NDArray[np.float64]:
        return (np.asarray(q, np.float64) - self._centre) / self.period + self._middle

    def _light(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the light (...) at pattern pixels, arrays that broadcast."""
        (cx, cy), (mx, my) = self._centre, self._middle
        u, v = (x - cx) / self.period + mx, (y - cy) / self.period + my
        light = self.background + (1 - self.background) * self._lines(u, v)
        if self.zero_order == 0:
            return light
        away = (x - cx) ** 2 + (y - cy) ** 2
        return light + self.zero_order * np.exp(-0.5 * away / self.zero_order_size**2)

    def _lines(self, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the light of the lines (...) at columns and rows, arrays that broadcast."""
        across = u - np.clip(np.round(u), 0, self.columns - 1)
        upright = across**2 + _beyond(v, self.rows) ** 2
        nearest = np.minimum(upright, self._from_horizontal(u, v))
        return np.exp(nearest * (-0.5 / self.line**2))

    def _from_horizontal(
        self, u: NDArray[np.float64], v: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the squared distance (...) to the nearest horizontal line, periods squared."""
        # A level node on either side lets the outer half pieces run on.
        code = np.pad(self.code, ((0, 0), (1, 1))) * (self.step / 2)
        start, rise = code[:, :-1], code[:, :-1] + code[:, 1:]
        left = np.clip(np.floor(u).astype(int), -1, self.columns - 1)
        row = np.clip(np.round(v).astype(int), 0, self.rows - 1)
        of_rows = _outer(u, v)
        nearest = np.inf
        # Steep pieces may come nearer to the neighbouring row than that row's own piece.
        for candidate in (row - 1, row, row + 1):
            clipped_row = np.clip(candidate, 0, self.rows - 1)
            rows = np.arange(self.rows)[:, None] if of_rows else clipped_row
            slope = rise[rows, left + 1]
            height = start[rows, left + 1] - slope * (u - left)  # above the row, y points down
            steep = 1 + slope**2
            if of_rows:
                height, steep = height[clipped_row[:, 0]], steep[clipped_row[:, 0]]
            nearest = np.minimum(nearest, (v - clipped_row + height) ** 2 / steep)
        return nearest + _beyond(u, self.columns) ** 2


def _beyond(along: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return how far a place lies beyond the ends of a line, half a period past its last nodes."""
    return np.maximum(np.abs(along - (count - 1) / 2) - count / 2, 0)


def _outer(u: NDArray[np.float64], v: NDArray[np.float64]) -> bool:
    """Tell whether ``u`` is a row (W,) and ``v`` a column (H, 1), as those of a texture are.

    Pieces are then looked up once for each of the grid's rows, and not for each place.
    """
    return u.ndim == 1 and v.ndim == 2 and v.shape[1] == 1


def _texels(extent: int, count: int) -> NDArray[np.float64]:
    """Return the middles of texels that cover pattern pixels -1/2 to extent - 1/2."""
    return (np.arange(count) + 0.5) * extent / count - 0.5

"""The image in cells of 3 x 3 pixels: what is smooth over a window is kept and solved there."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.floating]
"""Fields over the image or its cells; those of pixels are single precision."""
SIDE = 3
"""Pixels along a cell: less than the standard deviation of any window in use."""


@dataclass(frozen=True, eq=False)
class Links:
    """Which neighbouring cells lie on one surface."""

    right: NDArray[np.bool_]
    """(h, w - 1) a cell and the one right of it."""
    down: NDArray[np.bool_]
    """(h - 1, w) a cell and the one below."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return self.right.shape[0], self.down.shape[1]

    @cached_property
    def lone(self) -> NDArray[np.bool_]:
        """(h, w) cells that lack one of their eight neighbours, those at the border included."""
        lone = np.zeros(self.shape, np.uint8)
        lone[:, :-1] |= ~self.right
        lone[:, 1:] |= ~self.right
        lone[:-1] |= ~self.down
        lone[1:] |= ~self.down
        lone[[0, -1]] = 1
        lone[:, [0, -1]] = 1
        return np.asarray(cv2.dilate(lone, np.ones((3, 3), np.uint8)) > 0)

    @cached_property
    def lone_interpolations(self) -> "list[CellInterpolation]":
        """How each pixel of a lone cell is interpolated, by its place in the cell."""
        rows, columns = np.nonzero(self.lone)
        offsets = range(-(SIDE // 2), SIDE // 2 + 1)
        return [_interpolation(self, rows, columns, dx, dy) for dy in offsets for dx in offsets]

    def linked_to(self, rows: NDArray, columns: NDArray, x: int, y: int) -> NDArray[np.float32]:
        """Return 1 where cells are linked to their neighbour (x, y), along one axis, else 0."""
        link, at = (self.right, columns) if x else (self.down, rows)
        count = link.shape[1 if x else 0]
        if (x == 0 and y == 0) or count == 0:
            return np.zeros(len(rows), np.float32)
        first = at + min(x + y, 0)
        inside = (first >= 0) & (first < count)
        first = np.clip(first, 0, count - 1)
        linked = link[rows, first] if x else link[first, columns]
        return (linked & inside).astype(np.float32)


@dataclass(frozen=True, eq=False)
class CellInterpolation:
    """Interpolation of N pixels, one in each of N cells, between four cells."""

    rows: NDArray[np.intp]
    """(N,) of the pixels."""
    columns: NDArray[np.intp]
    cells: NDArray[np.intp]
    """(N, 4) a pixel's own cell and its neighbours, in the flattened image of cells."""
    weights: NDArray[np.float32]
    """(N, 4) of sum 1, zero for cells that are not linked to the pixel's own."""
    away: NDArray[np.float32]
    """(4, 2) the pixel's distance from the cells' middles, pixels."""


def _interpolation(
    links: Links, rows: NDArray, columns: NDArray, dx: int, dy: int
) -> CellInterpolation:
    """Return the interpolation of the pixels ``dx``, ``dy`` from the middles of cells (N,)."""
    h, w = links.shape
    tx, ty = abs(dx) / SIDE, abs(dy) / SIDE
    sx, sy = int(np.sign(dx)), int(np.sign(dy))
    across, down = links.linked_to(rows, columns, sx, 0), links.linked_to(rows, columns, 0, sy)
    corner = across * links.linked_to(rows, np.clip(columns + sx, 0, w - 1), 0, sy)
    shares = [np.full(len(rows), (1 - tx) * (1 - ty), np.float32), tx * (1 - ty) * across,
              (1 - tx) * ty * down, tx * ty * corner]  # fmt: skip
    steps = np.array([(0, 0), (sx, 0), (0, sy), (sx, sy)])
    weights = np.stack(shares, -1)
    cells = (np.clip(rows[:, None] + steps[:, 1], 0, h - 1) * w
             + np.clip(columns[:, None] + steps[:, 0], 0, w - 1))  # fmt: skip
    return CellInterpolation(
        rows * SIDE + SIDE // 2 + dy, columns * SIDE + SIDE // 2 + dx, cells,
        (weights / weights.sum(-1, keepdims=True)).astype(np.float32),
        (np.array([dx, dy]) - SIDE * steps).astype(np.float32),
    )  # fmt: skip


def middles(field: NDArray) -> NDArray:
    """Return the pixels (h, w, ...) in the middles of cells, of a field (h SIDE, w SIDE, ...)."""
    return field[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE]


def padded(image: NDArray, value: float = 0.0) -> NDArray:
    """Return an image (H, W, ...) filled up on the right and below to whole cells."""
    fill = [(0, -n % SIDE) for n in image.shape[:2]]
    return np.pad(image, fill + [(0, 0)] * (image.ndim - 2), constant_values=value)


def mean(field: Image) -> Image:
    """Return the means (h, w) over cells of a field (h SIDE, w SIDE)."""
    h, w = field.shape[0] // SIDE, field.shape[1] // SIDE
    return np.asarray(cv2.resize(field, (w, h), interpolation=cv2.INTER_AREA), np.float32)


def any_in(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells (h, w) that hold a pixel of the mask (h SIDE, w SIDE)."""
    h, w = mask.shape[0] // SIDE, mask.shape[1] // SIDE
    return np.asarray(mask.reshape(h, SIDE, w, SIDE).any((1, 3)))


def repeated(field: NDArray) -> NDArray:
    """Return a field (h, w, ...) with the value of each cell at all of its pixels."""
    return field.repeat(SIDE, 0).repeat(SIDE, 1)


def blend(value: Image, links: Links, slope: Image | None = None) -> Image:
    """Return pixels (h SIDE, w SIDE, K) interpolated between cells, but not across a fold.

    Bilinear between a pixel's own cell and those of its neighbours that are linked to it.

    Args:
        value: (h, w, K) at the middles of cells.
        links: which cells belong together.
        slope: (h, w, K, 2) per pixel along x and y. With it cells at folds and borders extend their
            own value to the pixel, so that what is linear stays so there.
    """
    h, w, channels = value.shape
    value = np.ascontiguousarray(value, np.float32)
    plain = cv2.resize(value, (w * SIDE, h * SIDE), interpolation=cv2.INTER_LINEAR)
    out = np.asarray(plain, np.float32).reshape(h * SIDE, w * SIDE, channels)
    for near in links.lone_interpolations:
        values = value.reshape(-1, channels)[near.cells]
        if slope is not None:
            rise = np.einsum("nfkd,fd->nfk", slope.reshape(-1, channels, 2)[near.cells], near.away)
            values = values + rise
        out[near.rows, near.columns] = np.einsum("nf,nfk->nk", near.weights, values)
    return out

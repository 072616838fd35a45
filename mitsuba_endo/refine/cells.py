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
    def beside_folds(self) -> NDArray[np.bool_]:
        """(h, w) cells that lack one of their eight neighbours, those at the border included."""
        lone = np.zeros(self.shape, np.uint8)
        lone[:, :-1] |= ~self.right
        lone[:, 1:] |= ~self.right
        lone[:-1] |= ~self.down
        lone[1:] |= ~self.down
        lone[[0, -1]] = 1
        lone[:, [0, -1]] = 1
        return np.asarray(cv2.dilate(lone, np.ones((3, 3), np.uint8)) > 0)

    def open_to(self, rows: NDArray, columns: NDArray, x: int, y: int) -> NDArray[np.float32]:
        """Return 1 where cells are linked to their neighbour (x, y), along one axis, else 0."""
        if x == 0 and y == 0:
            return np.zeros(len(rows), np.float32)
        link, at = (self.right, columns) if x else (self.down, rows)
        first = at + min(x + y, 0)
        inside = (first >= 0) & (first < link.shape[1 if x else 0])
        first = np.clip(first, 0, link.shape[1 if x else 0] - 1)
        found = link[rows, first] if x else link[first, columns]
        return (found & inside).astype(np.float32)


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
    out = np.asarray(plain, np.float32).reshape(h, SIDE, w, SIDE, channels)
    rows, columns = np.nonzero(links.beside_folds)
    if len(rows):
        for i in range(SIDE):
            for j in range(SIDE):
                dy, dx = i - SIDE // 2, j - SIDE // 2
                out[rows, i, columns, j] = _at_offset(value, links, slope, (rows, columns), dx, dy)
    return out.reshape(h * SIDE, w * SIDE, channels)


def _at_offset(
    value: Image,
    links: Links,
    slope: Image | None,
    cells: tuple[NDArray, NDArray],
    dx: int,
    dy: int,
) -> Image:
    """Return the interpolated values (N, K) at one pixel of some cells, given by rows, columns."""
    rows, columns = cells
    tx, ty = abs(dx) / SIDE, abs(dy) / SIDE
    sx, sy = int(np.sign(dx)), int(np.sign(dy))
    open_x = links.open_to(rows, columns, sx, 0)
    open_y = links.open_to(rows, columns, 0, sy)
    corner = open_x * links.open_to(rows, np.clip(columns + sx, 0, value.shape[1] - 1), 0, sy)
    total = np.zeros((len(rows), value.shape[2]), np.float32)
    weights = np.zeros(len(rows), np.float32)
    for x, y, weight in ((0, 0, (1 - tx) * (1 - ty) * np.ones_like(weights)),
                         (sx, 0, tx * (1 - ty) * open_x), (0, sy, (1 - tx) * ty * open_y),
                         (sx, sy, tx * ty * corner)):  # fmt: skip
        if not weight.any():
            continue
        at = (np.clip(rows + y, 0, value.shape[0] - 1), np.clip(columns + x, 0, value.shape[1] - 1))
        there = value[at]
        if slope is not None:
            there = there + slope[at] @ np.array([dx - SIDE * x, dy - SIDE * y], np.float32)
        total += weight[:, None] * there
        weights += weight
    return total / weights[:, None]

"""Gaussian windows on the grid of cells that stop at folds, and moments under them."""

from collections.abc import Sequence
from functools import cached_property

import cv2
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .cells import SIDE, Image, Links

REACH = 2.5
"""Standard deviations at which a window ends."""


class Windows:
    """One window around every cell: along its column and from there along rows, up to a fold.

    A window's weight is exp(-r^2 / (2 sigma^2)), 1 in the middle, and zero for cells that such a
    way cannot reach without crossing a fold.
    """

    def __init__(self, links: Links, sigma: float) -> None:
        """Build the windows.

        Args:
            links: which neighbouring cells lie on one surface.
            sigma: standard deviation, camera pixels.
        """
        self.shape = links.shape
        self.sigma = sigma
        self._links = links
        self._taps = _taps(sigma)

    @cached_property
    def _rows(self) -> "_Line":
        return _Line(self._links.right, self._taps, self.shape, along_rows=True)

    @cached_property
    def _columns(self) -> "_Line":
        return _Line(self._links.down.T, self._taps, self.shape, along_rows=False)

    def moments(self, *fields: Sequence[Image]) -> "WindowMoments":
        """Return windowed moments of fields (h, w).

        Args:
            fields: groups by the degree of the moments wanted, 0 first.
        """
        groups = list(fields) + [()] * (3 - len(fields))
        zero, one, two = (len(group) for group in groups)
        flat = np.stack([f.ravel() for group in reversed(groups) for f in group], -1)
        x0 = self._rows.sums(flat, 0)
        x1 = self._rows.sums(flat[:, : two + one], 1)
        x2 = self._rows.sums(flat[:, :two], 2)
        y0 = self._columns.sums(np.concatenate([x0, x1, x2], 1), 0)
        y1 = self._columns.sums(np.concatenate([x0[:, : two + one], x1[:, :two]], 1), 1)
        y2 = self._columns.sums(x0[:, :two], 2)
        every, linear = two + one + zero, two + one
        table = {(0, 0): y0[:, :every], (1, 0): y0[:, every : every + linear],
                 (2, 0): y0[:, every + linear :], (0, 1): y1[:, :linear],
                 (1, 1): y1[:, linear:], (0, 2): y2}  # fmt: skip
        starts = (linear, two, 0)
        return WindowMoments(table, starts)


class WindowMoments:
    """Sums over windows of a field times powers of the distance from the middle, camera pixels."""

    def __init__(self, table: dict[tuple[int, int], NDArray], starts: tuple[int, int, int]) -> None:
        self._table = {powers: values.T.astype(np.float64) for powers, values in table.items()}
        self._starts = starts

    def of(self, degree: int, index: int, x: int = 0, y: int = 0) -> NDArray[np.float64]:
        """Return the moment (h w,) of x^x y^y of one field of the group of this degree."""
        return self._table[x, y][self._starts[degree] + index] * float(SIDE ** (x + y))


def _taps(sigma: float) -> NDArray[np.float32]:
    reach = int(np.ceil(REACH * sigma / SIDE))
    offset = np.arange(-reach, reach + 1) * SIDE
    return np.exp(-0.5 * (offset / sigma) ** 2).astype(np.float32)


class _Line:
    """Windows along one axis: a plain filter, and a sparse one for the cells beside folds."""

    def __init__(
        self, link: NDArray[np.bool_], taps: NDArray[np.float32], shape: tuple[int, int],
        *, along_rows: bool,
    ) -> None:  # fmt: skip
        """Build the windows.

        Args:
            link: (lines, n - 1) whether a cell is linked to the next in its line.
            taps: (2 R + 1) the window's weights.
            shape: rows and columns of cells.
            along_rows: lines are rows, else columns.
        """
        self._taps, self._shape, self._along_rows = taps, shape, along_rows
        self._offset = np.arange(-(len(taps) // 2), len(taps) // 2 + 1)
        line, cell, kernel = _cut(link, taps)
        stride = 1 if along_rows else shape[1]
        self._cells = line * shape[1] + cell if along_rows else cell * shape[1] + line
        every = shape[0] * shape[1]
        index = np.clip(self._cells[:, None] + stride * self._offset, 0, every - 1).astype(np.int32)
        start = np.arange(0, kernel.size + 1, len(taps), dtype=np.int32)
        self._sparse = [
            sp.csr_array(((kernel * self._powers(k)).ravel(), index.ravel(), start),
                         shape=(len(kernel), every))
            for k in (0, 1, 2)
        ]  # fmt: skip

    def sums(self, flat: NDArray, power: int) -> NDArray[np.float32]:
        """Return sums (N, F) along lines of fields (N, F) times offset^power, in cells."""
        flat = np.ascontiguousarray(flat, np.float32)
        if flat.shape[1] == 0:
            return flat
        taps, one = self._taps * self._powers(power), np.ones(1, np.float32)
        kernels = (taps, one) if self._along_rows else (one, taps)
        image = flat.reshape(*self._shape, -1)
        out = cv2.sepFilter2D(image, -1, *kernels, borderType=cv2.BORDER_CONSTANT)
        out = np.asarray(out, np.float32).reshape(flat.shape)
        out[self._cells] = self._sparse[power] @ flat
        return out

    def _powers(self, power: int) -> NDArray[np.float32]:
        return (self._offset**power).astype(np.float32)


def _cut(
    link: NDArray[np.bool_], taps: NDArray[np.float32]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float32]]:
    """Return line, place (N,) and weights (N, T) of the cells whose windows a fold cuts."""
    reach, n = len(taps) // 2, link.shape[1] + 1
    torn = np.pad(~link, ((0, 0), (1, 1)))
    before = np.cumsum(torn, 1, dtype=np.int32)
    # before[:, i]: tears left of cell i; those within reach are the difference.
    index = np.arange(n)
    low, high = np.maximum(index - reach, 0), np.minimum(index + reach, n - 1)
    line, cell = np.nonzero(before[:, high] != before[:, low])
    there = cell[:, None] + np.arange(-reach, reach + 1)
    inside = (there >= 0) & (there < n)
    tears = before[line[:, None], np.clip(there, 0, n - 1)]
    kernel = np.where(inside & (tears == before[line, cell][:, None]), taps, 0)
    return line, cell, kernel.astype(np.float32)

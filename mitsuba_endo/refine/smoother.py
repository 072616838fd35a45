"""Local linear regression of fields on cells: smoothing that keeps slopes, up to borders."""

import numpy as np
from numpy.typing import NDArray

from .cells import SIDE, Image, Links, blend, mean
from .windows import WindowMoments, Windows

LEAST = 1e-3
"""Least share of its variance that a direction must keep to have a slope; below, it has none."""


class Smoother:
    """Fits value and slope around every cell to what is known under its window."""

    def __init__(self, windows: Windows, links: Links, weight: Image) -> None:
        """Prepare the fit.

        Args:
            windows: around the cells.
            links: of the same cells.
            weight: (h SIDE, w SIDE) weight of each pixel, 0 = missing.
        """
        self._windows, self._links, self._weight = windows, links, weight
        self._x, self._y = _inside_cells(weight.shape)
        x, y = self._x, self._y
        inner = [weight * x, weight * y, weight * x * x, weight * x * y, weight * y * y]
        fields = [mean(f) for f in inner]
        self._sums = [*fields[:2], mean(weight)]
        m = windows.moments(fields[2:], fields[:2], self._sums[2:])
        self.support = m.of(2, 0)
        """(h w,) sum of the weights under each window, in cells."""
        self._sx = m.of(2, 0, 1, 0) + m.of(1, 0)
        self._sy = m.of(2, 0, 0, 1) + m.of(1, 1)
        sxx = m.of(2, 0, 2, 0) + 2 * m.of(1, 0, 1, 0) + m.of(0, 0)
        sxy = m.of(2, 0, 1, 1) + m.of(1, 0, 0, 1) + m.of(1, 1, 1, 0) + m.of(0, 1)
        syy = m.of(2, 0, 0, 2) + 2 * m.of(1, 1, 0, 1) + m.of(0, 2)
        self._invert(sxx, sxy, syy)

    def _invert(self, sxx: NDArray, sxy: NDArray, syy: NDArray) -> None:
        """Invert the 2 x 2 covariance of places under each window."""
        s = np.maximum(self.support, 1e-9)
        ridge = LEAST * s * self._windows.sigma**2
        a = sxx - self._sx**2 / s + ridge
        b = sxy - self._sx * self._sy / s
        c = syy - self._sy**2 / s + ridge
        det = a * c - b * b
        self._inverse = c / det, -b / det, a / det

    def fit(self, field: Image) -> tuple[Image, Image]:
        """Return values (h, w) at the middles of cells and slopes (h, w, 2) per pixel.

        Args:
            field: (h SIDE, w SIDE); what lies where nothing is known does not matter if finite.
        """
        weighted = self._weight * field
        inner = [mean(weighted * self._x), mean(weighted * self._y)]
        m = self._windows.moments(inner, [mean(weighted)])
        return self._solve(m)

    def of_cells(self, values: Image) -> Image:
        """Return smoothed values (h, w, K) of a field that is even over each cell, twiced."""
        first = self._once(values)
        return first + self._once(values - first)

    def _once(self, values: Image) -> Image:
        x, y, one = self._sums
        out = []
        for k in range(values.shape[-1]):
            v = values[..., k]
            out.append(self._solve(self._windows.moments([v * x, v * y], [v * one]))[0])
        return np.stack(out, -1)

    def _solve(self, m: WindowMoments) -> tuple[Image, Image]:
        s = np.maximum(self.support, 1e-9)
        total = m.of(1, 0)
        bx = m.of(1, 0, 1, 0) + m.of(0, 0) - self._sx * total / s
        by = m.of(1, 0, 0, 1) + m.of(0, 1) - self._sy * total / s
        p, r, t = self._inverse
        gx, gy = p * bx + r * by, r * bx + t * by
        value = (total - gx * self._sx - gy * self._sy) / s
        shape = self._windows.shape
        slope = np.stack([gx, gy], -1).astype(np.float32)
        return value.astype(np.float32).reshape(shape), slope.reshape(*shape, 2)

    def cells(self, field: Image) -> tuple[Image, Image]:
        """Return values (h, w, K) and slopes (h, w, K, 2) of a field (h SIDE, w SIDE, K), twiced.

        Twicing fits what the first fit left and adds it, which keeps curvature too.
        """
        first = _stacked([self.fit(field[..., k]) for k in range(field.shape[-1])])
        rest = field - blend(first[0], self._links, first[1])
        second = _stacked([self.fit(rest[..., k]) for k in range(field.shape[-1])])
        return first[0] + second[0], first[1] + second[1]

    def pixels(self, field: Image) -> Image:
        """Return the smoothed field (h SIDE, w SIDE, K)."""
        value, slope = self.cells(field)
        return blend(value, self._links, slope)


def _stacked(fits: list[tuple[Image, Image]]) -> tuple[Image, Image]:
    return np.stack([f[0] for f in fits], -1), np.stack([f[1] for f in fits], -2)


def _inside_cells(shape: tuple[int, ...]) -> tuple[Image, Image]:
    """Return each pixel's distance (1, W) and (H, 1) from the middle of its cell."""
    x, y = (np.arange(n, dtype=np.float32) % SIDE - SIDE // 2 for n in (shape[1], shape[0]))
    return x[None], y[:, None]

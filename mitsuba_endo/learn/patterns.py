"""Many coded grids as textures, so that the network learns codes and not one pattern."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.grid_pattern import CodedGrid

TEXELS = 20
"""Texels per period."""
MARGIN = 1
"""Periods of background around the outer nodes."""


@dataclass(frozen=True, eq=False)
class GridTexture:
    """One coded grid, ready to be projected."""

    light: NDArray[np.float32]
    """Brightness at TEXELS per period; MARGIN periods before the first node are texel 0."""
    code: NDArray[np.int8]
    """(rows, columns) of -1, 0 and 1."""

    def turned(self) -> "GridTexture":
        """Return the grid upside down, which is a valid grid too: steps stay as they are."""
        return GridTexture(self.light[::-1, ::-1], self.code[::-1, ::-1])

    def at(self, lattice: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the light (H, W) at column and row (H, W, 2); dark outside and at NaN."""
        texel = (lattice + np.float32(MARGIN)) * np.float32(TEXELS) - np.float32(0.5)
        texel = np.nan_to_num(texel, nan=-100.0)
        light = np.ascontiguousarray(self.light)
        x, y = texel[..., 0], texel[..., 1]
        return np.asarray(cv2.remap(light, x, y, cv2.INTER_LINEAR, borderValue=(0.0,)), np.float32)


@cache
def grid_texture(seed: int) -> GridTexture:
    """Return the coded grid of ``seed``: code, size, step, line width and stray light are random.

    The endoscope's own pattern, whose code has seed 0, is not among them.
    """
    rng = np.random.default_rng((seed, 77))
    columns, rows = (int(n) for n in rng.integers(26, 42, 2))
    extent = np.array([columns, rows]) - 1 + 2 * MARGIN
    grid = CodedGrid(
        # One pattern pixel a texel puts texel centres at (k + 1/2) / TEXELS - MARGIN periods.
        width=int(extent[0] * TEXELS), height=int(extent[1] * TEXELS), columns=columns, rows=rows,
        period=float(TEXELS), step=rng.uniform(0.25, 0.32), line=rng.uniform(0.045, 0.08),
        background=rng.uniform(0, 0.06), seed=1000 + seed,
    )  # fmt: skip
    return GridTexture(grid.texture(grid.width, grid.height), grid.code)

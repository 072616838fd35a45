"""A small cache of views without Mitsuba: analytic surfaces, for tests."""

import numpy as np

from mitsuba_endo.learn.cache import ViewCache
from mitsuba_endo.learn.views import BIT_EDGE, BIT_HIT, BIT_MIXED, LATTICE_UNIT, UNLIT


def step_cache(width: int = 96, height: int = 80, period: float = 10.0) -> ViewCache:
    """Return one view: a slanted grid, a depth edge at x = 60, a shadow in the lower left corner.

    Column = (x - 40) / period + 0.02 y, and 3.4 more right of the edge; row = (y - 30) / period.
    """
    y, x = (np.mgrid[: 2 * height, : 2 * width] - 0.5) / 2
    u = (x - 40) / period + 0.02 * y + np.where(x > 60, 3.4, 0)
    lattice = np.stack([u, (y - 30) / period], -1)
    stored = np.round(lattice / LATTICE_UNIT).astype(np.int16)
    stored[(y > 60) & (x < 20)] = UNLIT
    shading = np.ones((1, height, width, 4), np.float16)
    flags = np.full((1, height, width), BIT_HIT, np.uint8)
    flags[:, :, 60:62] |= BIT_MIXED | BIT_EDGE
    return ViewCache(stored[None], shading, flags, ["step"])

"""Smoothing of the start: as broad as the surface allows, for the window cannot mend what is fine.

Errors of a start that are finer than the window stay, and since the image speaks on lines alone,
they do not even average out: what is wrong on the lines is taken for the whole window's error. A
decoder makes such errors once a period. So the start is smoothed under broad windows, and under
narrow ones where both differ by more than errors do, which is where the surface bends.
"""

import numpy as np

from .cells import Image, Links, blend, mean
from .smoother import Smoother
from .windows import Windows

BEND = 0.2
"""Pattern pixels by which both may differ before the narrow one counts: what is fine in a decoder's
errors, 0.01 to 0.02 grid periods. Chosen on photographs of seeds that no benchmark has."""


def smoothed_start(
    q: Image, weight: Image, links: Links, windows: Windows, broad: Smoother
) -> Image:
    """Return smooth coordinates (h SIDE, w SIDE, 2).

    Args:
        q: (h SIDE, w SIDE, 2) pattern pixels, finite.
        weight: (h SIDE, w SIDE) 1 where a pixel has a coordinate, else 0.
        links: which cells belong together.
        windows: the narrow ones.
        broad: of the same pixels, under broad windows.
    """
    value, slope = Smoother(windows, links, weight).cells(q)
    wide_value, wide_slope = broad.cells(q)
    share = _share(value - wide_value, mean(weight), windows)[..., None]
    mixed = wide_value + share * (value - wide_value)
    return blend(mixed, links, wide_slope + share[..., None] * (slope - wide_slope))


def _share(apart: Image, weight: Image, windows: Windows) -> Image:
    """Return the narrow windows' share (h, w), 0 to 1, from how both differ around each cell."""
    squared = np.square(apart).sum(-1)
    m = windows.moments([weight * squared, weight])
    around = (m.of(0, 0) / np.maximum(m.of(0, 1), 1e-6)).reshape(windows.shape)
    return np.square(around / (around + BEND**2)).astype(np.float32)

"""Closed quads of four links, which confirm each other."""

import numpy as np
from numpy.typing import NDArray

from .links import Links


def quads(links: Links, count: int) -> NDArray[np.intp]:
    """Return how many closed quads each link (L,) belongs to, of a graph of ``count`` nodes."""
    to = np.full((2, count + 1), count)
    number = np.full((2, count + 1), len(links))
    to[links.axis, links.start] = links.end
    number[links.axis, links.start] = np.arange(len(links))
    right, down = to
    corner = np.flatnonzero((right[down] == down[right]) & (right[down] < count))
    used = np.zeros(len(links) + 1, np.intp)
    for axis, start in ((0, corner), (1, corner), (0, down[corner]), (1, right[corner])):
        np.add.at(used, number[axis, start], 1)
    return used[:-1]

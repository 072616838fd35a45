"""What the coded grid means at every pixel of a capture."""

import numpy as np
from numpy.typing import NDArray

from ..decoding.grid_pattern import CodedGrid, GridTruth
from ..description import read_description
from .pattern import parse_pattern
from .scene import LoadedScene

PATTERN = "pattern"
"""The scene parameter that names the projector's pattern."""


def coded_grid(loaded: LoadedScene) -> CodedGrid | None:
    """Return the grid of a scene whose pattern is ``pattern:coded``, else None."""
    value = loaded.parameters.get(PATTERN, "")
    if not value.startswith("pattern:"):
        return None
    name, settings = read_description(value, "pattern", PATTERN)
    pattern = parse_pattern(name, **settings)
    return pattern if isinstance(pattern, CodedGrid) else None


def grid_truth(
    grid: CodedGrid, q: NDArray[np.floating], pattern_size: tuple[int, int]
) -> GridTruth:
    """Return phase, code and node (H, W[, 2]) at pattern coordinates ``q`` (H, W, 2).

    Args:
        grid: which is projected.
        q: pattern pixels of a projector of ``pattern_size``; NaN where nothing is known.
        pattern_size: width and height over which the projector stretches the grid's image.
    """
    stretch = np.array([grid.width, grid.height]) / np.array(pattern_size)
    return grid.truth((np.asarray(q, np.float64) + 0.5) * stretch - 0.5)

"""Which nodes of an image are which nodes of the pattern."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Identity:
    """The nodes' places in the pattern."""

    placed: NDArray[np.bool_]
    """(N,) nodes that were identified."""
    node: NDArray[np.intp]
    """(N, 2) column and row in the pattern, -1 where not placed."""
    turn: int
    """1 if the pattern is seen upright, -1 upside down."""
    read: float
    """Share of the placed nodes whose most probable code is that of the pattern, 0 if none."""

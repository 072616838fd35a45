"""How surfaces answer to the global unknowns."""

import numpy as np
from numpy.typing import NDArray

from ..elimination.banded_cholesky import BandedCholesky
from ..elimination.coupling import Coupling

_COLUMNS = 32
"""Columns of a response that are computed at once."""


def response(
    factor: BandedCholesky, B: Coupling, directions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how a surface answers, A^-1 B d (V, n), to directions d (G, n) of the globals."""
    out = np.empty((B.shape[0], directions.shape[1]))
    for start in range(0, out.shape[1], _COLUMNS):
        part = slice(start, start + _COLUMNS)
        out[:, part] = factor.solve(B @ directions[:, part])
    return out

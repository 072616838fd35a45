"""Period (fringe-order) errors of a decoder: coordinates off by whole periods of the grid.

The redescending loss switches them off like any gross error; counted apart, they tell whoever runs
the decoder where it went wrong.
"""

import numpy as np
from numpy.typing import NDArray

_NEAR = 0.2
"""Distance from a whole number of periods, in periods, that still counts as one."""


def count_period_errors(
    observed: NDArray[np.floating], rendered: NDArray[np.floating], period: float
) -> int:
    """Return how many correspondences are off by whole periods, and not by none.

    Args:
        observed: (H, W, 2) pattern pixels, NaN = missing.
        rendered: (H, W, 2) likewise, from the solution.
        period: of the grid, pattern pixels.
    """
    r = (observed - rendered) / period
    r = r[np.isfinite(r).all(-1)]
    whole = np.round(r)
    return int(((np.abs(r - whole) < _NEAR).all(-1) & whole.any(-1)).sum())

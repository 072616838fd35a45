"""The coded grid's truth of a capture, as an image file."""

from pathlib import Path

import numpy as np

from ..decoding.grid_pattern import GridTruth
from ..records.exr_files import write_exr

GRID_TRUTH = "truth_grid.exr"
"""No map: it has no channel that a solver reads."""


def save_grid_truth(path: Path, truth: GridTruth) -> None:
    """Write channels ``phase.x``, ``phase.y`` (radians), ``node.column``, ``node.row``, ``code``.

    NaN outside the grid, in every channel.
    """
    outside = (truth.node < 0).any(-1)
    channels = {
        "phase.x": truth.phase[..., 0], "phase.y": truth.phase[..., 1],
        "node.column": truth.node[..., 0], "node.row": truth.node[..., 1], "code": truth.code,
    }  # fmt: skip
    write_exr(path, {name: np.where(outside, np.nan, c) for name, c in channels.items()})

"""The cost per iteration as a chart of the viewer's panel."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import Snapshot
from ..colours import CAMERA, PROJECTOR, UNUSED
from .nodes import small

_WHOLE = tuple(digit * 10.0**power for power in range(4) for digit in (1, 2, 5))
"""1, 2, 5, 10, ... 5000 iterations between marks of the axis, because iterations
are whole."""
Data = tuple[NDArray[np.float64], ...]
NOTE = (
    "Blue: robust cost per correspondence, in units of the robust scale, and so it jumps where "
    "that changes. Grey: the scale, pattern px."
)


def chart_data(history: Sequence[Snapshot], marked: int | None) -> Data:
    """Return iterations, costs, scales, and the cost of the marked one with NaN elsewhere."""
    rows = [(s.iteration, s.cost, s.scale_px, i) for i, s in enumerate(history) if s.cost]
    iteration, cost, scale, index = np.array(rows or [(0, 1.0, 1.0, -1)], float).T
    return iteration, cost, scale, np.where(index == marked, cost, np.nan)


def add_cost_chart(server: Any, history: Sequence[Snapshot]) -> Any:
    """Add the chart to the panel, with a note of what it shows."""
    from viser import uplot  # pyright: ignore[reportMissingImports]

    line = uplot.Series(label="cost", stroke=CAMERA, width=2, points={"show": True})
    scale = uplot.Series(label="scale", stroke=UNUSED, width=1.5, dash=(5.0, 4.0))
    mark = uplot.Series(
        label="shown", stroke=PROJECTOR, width=0,
        points={"show": True, "size": 11, "fill": PROJECTOR},
    )  # fmt: skip
    chart = server.gui.add_uplot(
        data=chart_data(history, None),
        series=(uplot.Series(label="iteration"), line, scale, mark),
        scales={"x": uplot.Scale(time=False), "y": uplot.Scale(distr=3)},
        axes=(
            uplot.Axis(label="iteration", labelSize=18, size=34, incrs=_WHOLE),
            uplot.Axis(label="robust cost", labelSize=18, size=56),
        ),
        legend=uplot.Legend(show=False),
        padding=(14, 10, 0, 0),
        aspect=1.9,
    )
    server.gui.add_html(small(NOTE))
    return chart

"""The cost per iteration as a chart of the viewer's panel."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records.calibration import Snapshot
from ..colours import CAMERA, PROJECTOR

Data = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def chart_data(history: Sequence[Snapshot], marked: int | None) -> Data:
    """Return iterations, their costs, and the cost of the marked one with NaN elsewhere."""
    rows = [(s.iteration, s.cost, i) for i, s in enumerate(history) if s.cost is not None]
    rows = rows or [(0, 1.0, -1)]
    cost = np.array([row[1] for row in rows], float)
    mark = np.array([row[2] == marked for row in rows])
    return np.array([row[0] for row in rows], float), cost, np.where(mark, cost, np.nan)


def add_cost_chart(server: Any, history: Sequence[Snapshot]) -> Any:
    """Add the chart to the panel."""
    from viser import uplot

    line = uplot.Series(label="cost", stroke=CAMERA, width=2, points={"show": True})
    mark = uplot.Series(
        label="shown", stroke=PROJECTOR, width=0,
        points={"show": True, "size": 11, "fill": PROJECTOR},
    )  # fmt: skip
    return server.gui.add_uplot(
        data=chart_data(history, None),
        series=(uplot.Series(label="iteration"), line, mark),
        scales={"x": uplot.Scale(time=False), "y": uplot.Scale(distr=3)},
        axes=(
            uplot.Axis(label="iteration", labelSize=18, size=34),
            uplot.Axis(label="robust cost", labelSize=18, size=56),
        ),
        legend=uplot.Legend(show=False),
        padding=(14, 10, 0, 0),
        aspect=1.9,
    )

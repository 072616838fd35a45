"""Margins of charts. Oracle: matplotlib's own boxes around everything that axes draw."""

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from mitsuba_endo.records.calibration import Calibration, TraceRow
from mitsuba_endo.show import figures
from mitsuba_endo.show.frame_charts import frame_charts
from mitsuba_endo.show.view import view_surface

TRACE = [TraceRow(k, 1.26 + 1e-5 * k, 0.1, 17999.98765 + 1e-4 * k, 1, 1, 0.1) for k in range(5)]
SMALL = 0.02
"""Inches by which a label may reach over the border: its box is larger than its ink."""


@pytest.fixture(scope="module")
def calibration(make_calibration: Callable[..., Calibration]) -> Calibration:
    return make_calibration(width=64, height=46, count=2)


def _drawn(calibration: Calibration) -> list[Figure]:
    names = [f"projector pose of a frame with a long name {k} (rotation about x)" for k in range(9)]
    view = view_surface(calibration.surface, calibration.camera)
    return [
        figures.histogram_figure(calibration.frames, 0.3, 1.0),
        figures.convergence_figure(TRACE),
        figures.rig_figure(calibration, view),
        figures.correlation_figure(names, np.eye(9).tolist()),
        *(figure for _, figure in frame_charts(calibration.solution)),
    ]


def test_nothing_is_cut_off_and_nothing_overlaps(calibration: Calibration):
    """Oracle: the boxes lie within the figure, and those of different axes apart."""
    drawn = _drawn(calibration)
    assert len(drawn) >= 6
    for figure in drawn:
        width, height = figure.get_size_inches()
        figure.set_size_inches(5.2, 5.2 * height / width)
        figure.draw_without_rendering()
        boxes = [axes.get_tightbbox().transformed(figure.dpi_scale_trans.inverted())
                 for axes in figure.axes]  # fmt: skip
        width, height = figure.get_size_inches()
        for k, box in enumerate(boxes):
            assert min(box.x0, box.y0, width - box.x1, height - box.y1) > -SMALL, (k, box)
            if figure.axes[k].get_label() == "<colorbar>":
                continue  # lower than the title, which may be wider than its plot
            for other in boxes[:k]:
                apart = box.padded(-SMALL), other.padded(-SMALL)
                assert not apart[0].overlaps(apart[1]), (box, other)


def test_room_is_used(calibration: Calibration):
    """Oracle: the plot of the residuals takes most of its figure."""
    (figure, *_) = _drawn(calibration)
    figure.draw_without_rendering()
    assert figure.axes[0].get_position().width > 0.85
    assert figure.axes[0].get_position().height > 0.75

"""Margins of a figure: plots below one another, placed in one pass over their labels."""

from matplotlib.figure import Figure
from matplotlib.layout_engine import LayoutEngine

PAD = 0.06
"""Inches around everything."""
LINE = 0.17
"""Inches of a line of text and the gap beside it: matplotlib's ten points."""
TICK = 0.08
"""Inches of a tick mark and the gap to its label."""
BAR = 0.5
"""Inches of the numbers beside a colour bar."""


class Margins(LayoutEngine):
    """Leaves room for what stands around the axes.

    Only the labels of y are measured, since they alone are of any length: heights of lines are
    known. matplotlib's constrained layout measures everything twice, longer than drawing takes.
    """

    _adjust_compatible = True
    _colorbar_gridspec = True

    def __init__(self, right: float = LINE) -> None:
        """Take what the labels do not say.

        Args:
            right: inches beside the axes, for half a label of x, or for a colour bar's labels.
        """
        super().__init__()
        self._right = right

    def execute(self, fig: Figure) -> None:
        """Place the axes."""
        plots = [axes for axes in fig.axes if axes.get_label() != "<colorbar>"]
        width, height = fig.get_size_inches()
        left = PAD
        for axes in plots:
            labels = axes.yaxis.get_tightbbox()
            if labels is not None:
                left = max(left, PAD + (axes.bbox.x0 - labels.x0) / fig.dpi)
        title = LINE + 2 * PAD if any(axes.get_title() for axes in plots) else PAD
        below = TICK + LINE * (2 if any(axes.get_xlabel() for axes in plots) else 1)
        gap = LINE
        grid = plots[0].get_gridspec()
        rows = 1 if grid is None else grid.nrows
        room = (height - title - below - gap * (rows - 1)) / rows
        fig.subplots_adjust(
            left=left / width, right=1 - self._right / width, bottom=below / height,
            top=1 - title / height, hspace=gap / room,
        )  # fmt: skip

"""Results as a notebook shows them: the report's verdict and table in a cell."""

from markupsafe import Markup

from ..records.solution import Solution
from .report_content import number_groups, verdict_of
from .templating import render

_STYLE = """
.mitsuba-endo .badge { padding: 0 .5em; border-radius: .6em; background: #d5ebe4; color: #12382c; }
.mitsuba-endo .badge.wary { background: #f6dfc0; color: #4a2c00; }
.mitsuba-endo table { margin: .6em 0; border-collapse: collapse; }
.mitsuba-endo th, .mitsuba-endo td { text-align: left; padding: .15em .8em; }
.mitsuba-endo .number { text-align: right; font-variant-numeric: tabular-nums; }
.mitsuba-endo .group th { border-bottom: 1px solid; }
.mitsuba-endo .reason { opacity: .75; }
.mitsuba-endo tr.unobservable td { opacity: .75; }
"""


def solution_html(solution: Solution) -> str:
    """Return verdict and values of a solution as a piece of HTML that brings its own style."""
    return render(
        "notebook.html", style=Markup(_STYLE), said=verdict_of(solution),
        groups=number_groups(solution),
    )  # fmt: skip

"""Rules against the graph network at equal coverage: wrong periods over coverage, per scenario."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..decode.grid.graph import GridGraph, build_graph, graph_of
from ..decode.grid.heads import Heads, smoothed
from ..decode.grid.identify import identify
from ..decode.grid.links import MAX_EDGE, MAX_TURN_ERROR, MIN_CONFIDENCE
from ..decode.grid.nodes import larger
from ..decode.grid.unwrap import unwrap
from ..files import atomic_path
from .compose import Truth
from .graph_features import candidates
from .graph_model import GraphNet

WRONG = 0.5
"""Periods of error on an axis from which a pixel is in a wrong period."""
THRESHOLDS = np.round(np.arange(0.5, 0.96, 0.05), 2)
"""Confidence asked of a pixel; below the first the decoder keeps none."""
LEAST_ODDS, SURE_ODDS = np.log(0.1 / 0.9), 5.0
"""Logs of the odds of a link that is kept, and of one that costs the full price to cut."""
METHODS = ("rules", "graph network")


@dataclass(frozen=True, eq=False)
class Curve:
    """One method on one kind of image."""

    coverage: NDArray[np.float64]
    """(T,) decoded share of the lit pixels, at THRESHOLDS."""
    wrong: NDArray[np.float64]
    """(T,) share of the decoded lit pixels that are in a wrong period."""

    def at(self, coverage: float) -> float:
        """Return the wrong share where the curve has a given coverage."""
        return float(np.interp(coverage, self.coverage[::-1], self.wrong[::-1]))


@dataclass(frozen=True, eq=False)
class Case:
    """One image as the pixel network sees it, and what it shows."""

    scenario: str
    heads: Heads
    truth: Truth
    code: NDArray[np.int8]
    """(rows, columns) of its pattern."""


def curves(cases: Sequence[Case], net: GraphNet) -> dict[str, dict[str, Curve]]:
    """Return a curve for each scenario and method."""
    found: dict[str, dict[str, Curve]] = {}
    for scenario in dict.fromkeys(case.scenario for case in cases):
        chosen = [case for case in cases if case.scenario == scenario]
        found[scenario] = {
            method: _curve([_counts(case, net if method != "rules" else None) for case in chosen])
            for method in METHODS
        }
    return found


def judged_graph(heads: Heads, net: GraphNet) -> GridGraph:
    """Return the graph whose links are as good as the network says.

    Links that it believes in, and that the rules allow, are kept; their quality, which is the price
    of cutting them, is the log of their odds.
    """
    found = candidates(heads)
    links, measures = found.links, found.measures
    told = (found.about_nodes, found.about_links, links.start, links.end)
    with torch.no_grad():
        odds = net(*(torch.from_numpy(array) for array in told))[1].double().numpy()
    allowed = (larger(measures.turn_error) < MAX_TURN_ERROR) & (measures.edge < MAX_EDGE)
    allowed &= (measures.confidence > MIN_CONFIDENCE) & (odds > LEAST_ODDS)
    judged = replace(links, quality=np.clip(odds / SURE_ODDS, 0, 1))
    return graph_of(found.nodes, judged.chosen(allowed))


def _counts(case: Case, net: GraphNet | None) -> NDArray[np.float64]:
    """Return lit, decoded and wrong pixels (3, T)."""
    heads = smoothed(case.heads)
    graph = build_graph(heads) if net is None else judged_graph(heads, net)
    lattice = unwrap(heads, graph.nodes, identify(graph, case.code))
    error = np.abs(lattice - case.truth.lattice.transpose(1, 2, 0)).max(-1)
    decoded = case.truth.lit & np.isfinite(error)
    sure, error = heads.confidence[decoded], error[decoded]
    above = [sure > least for least in THRESHOLDS]
    lit = np.full(len(above), case.truth.lit.sum())
    return np.array([lit, [a.sum() for a in above], [(error[a] > WRONG).sum() for a in above]])


def _curve(counts: Sequence[NDArray[np.float64]]) -> Curve:
    lit, decoded, wrong = np.sum(counts, axis=0)
    return Curve(decoded / np.maximum(lit, 1), wrong / np.maximum(decoded, 1))


def save_comparison(path: Path, found: Mapping[str, Mapping[str, Curve]]) -> None:
    """Draw the curves, one panel a scenario."""
    columns = min(len(found), 4)
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(3.2 * columns, 3.2 * rows), dpi=110, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).flat
    for (scenario, methods), axes in zip(found.items(), panels, strict=False):
        for method, curve in methods.items():
            axes.plot(100 * curve.coverage, 100 * curve.wrong, ".-", label=method)
        axes.set_title(scenario, fontsize=10)
        axes.set_xlabel("coverage (%)")
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    for axes in panels:  # those that are left
        axes.remove()
    figure.axes[0].set_ylabel("wrong period (%)")
    figure.axes[0].legend(fontsize=8)
    with atomic_path(path) as aside:
        figure.savefig(aside)

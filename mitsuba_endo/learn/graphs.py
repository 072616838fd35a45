"""Graphs as the decoder finds them, with the truth of each node and link."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..decode.grid.heads import Heads, smoothed
from ..decode.grid.links import Links
from ..decode.grid.nodes import larger
from .compose import Truth
from .graph_features import candidates

RIGHT = 0.25
"""Periods by which a node may miss its true place."""


@dataclass(frozen=True, eq=False)
class LabelledGraph:
    """Features and truth of one image's graph."""

    node: NDArray[np.float32]
    """(N, F) features."""
    link: NDArray[np.float32]
    """(L, G) features."""
    links: Links
    node_real: NDArray[np.bool_]
    """(N,) lies at a node of the grid, lit."""
    link_real: NDArray[np.bool_]
    """(L,) joins neighbours of the pattern."""


def labelled_graph(heads: Heads, truth: Truth) -> LabelledGraph:
    """Return the graph that the network's outputs for an image give, and its truth."""
    heads = smoothed(heads)
    found = candidates(heads)
    nodes, links = found.nodes, found.links
    row, column = nodes.pixel
    at = truth.lattice[:, row, column].T
    node = np.rint(at)
    real = truth.lit[row, column] & (larger(at - node) < RIGHT)
    away = node[links.end] - node[links.start]
    joined = real[links.start] & real[links.end] & (away == links.step).all(1)
    return LabelledGraph(
        node=found.about_nodes,
        link=found.about_links,
        links=links,
        node_real=real,
        link_real=joined,
    )

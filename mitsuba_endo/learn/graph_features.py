"""What the graph network is told of nodes and links: numbers of about one."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decode.grid.heads import Heads
from ..decode.grid.links import Links, Measures, candidate_links
from ..decode.grid.nodes import Nodes, find_nodes, larger
from ..decode.grid.quads import quads

NODE_FEATURES = (
    "confidence", "confidence_around", "edge", "code", "log_period_x", "log_period_y", "skew",
    "links",
)  # fmt: skip
LINK_FEATURES = (
    "downwards", "turn_error", "turn_error_x", "turn_error_y", "edge", "edge_mean", "confidence",
    "confidence_least", "miss", "miss_other", "slope_change", "quads",
)  # fmt: skip
TYPICAL_PERIOD = 10.0
"""Pixels."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Whatever may be a node or a link of an image, with the features of each."""

    nodes: Nodes
    links: Links
    measures: Measures
    about_nodes: NDArray[np.float32]
    """(N, F) features."""
    about_links: NDArray[np.float32]
    """(L, G) features."""


def candidates(heads: Heads) -> Candidates:
    """Return what the pixel network's smoothed outputs offer."""
    nodes = find_nodes(heads)
    links, measures = candidate_links(nodes, heads)
    closed = quads(links, len(nodes))
    return Candidates(
        nodes, links, measures, node_features(nodes, links, heads),
        link_features(nodes, links, measures, closed),
    )  # fmt: skip


def node_features(nodes: Nodes, links: Links, heads: Heads) -> NDArray[np.float32]:
    """Return (N, F) features in the order of NODE_FEATURES."""
    at = nodes.pixel
    near, wide = (cv2.blur(heads.confidence, (n, n))[at] for n in (3, 11))
    edge = cv2.dilate(heads.edge, np.ones((5, 5), np.uint8))[at]
    inverse = np.linalg.inv(nodes.slope)
    period = np.linalg.norm(inverse, axis=1)
    skew = np.einsum("ni,ni->n", inverse[:, :, 0], inverse[:, :, 1]) / period.prod(1)
    degree = np.bincount(np.concatenate([links.start, links.end]), minlength=len(nodes)) / 4
    log_period = np.log(period / TYPICAL_PERIOD)
    columns = [near, wide, edge, nodes.code.max(1), *log_period.T, skew, degree]
    return np.stack(columns, -1).astype(np.float32)


def link_features(
    nodes: Nodes, links: Links, measures: Measures, closed: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Return (L, G) features in the order of LINK_FEATURES.

    Args:
        nodes: of the image.
        links: between them.
        measures: of the links.
        closed: (L,) quads that each link belongs to.
    """
    away = nodes.at[links.end] - nodes.at[links.start]
    ends = [nodes.slope[end] for end in (links.start, links.end)]
    miss = [larger(np.einsum("lij,lj->li", slope, away) - links.step) for slope in ends]
    change = larger(np.einsum("lij,lj->li", ends[1] - ends[0], away))
    error = np.minimum(measures.turn_error, 1)
    columns = [
        links.axis, larger(error), *error.T, measures.edge, measures.edge_mean,
        measures.confidence, measures.confidence_least, np.minimum(np.minimum(*miss), 1),
        np.minimum(np.maximum(*miss), 1), np.minimum(change, 1), closed / 2,
    ]  # fmt: skip
    return np.stack(columns, -1).astype(np.float32)

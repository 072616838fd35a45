"""Nodes in no closed quad, placed by a single link to a node that is placed already."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .graph import GridGraph
from .heads import CODES
from .identity import Identity

ROUNDS = 2
"""Links in a row that lead away from a placed quad."""
MIN_QUALITY = 0.5
"""Of the link: no quad confirms it."""
MIN_EVIDENCE = 0.2
"""Of the node's own code for its place: about half as probable again as by chance."""


def with_pendants(
    graph: GridGraph, identity: Identity, logs: NDArray[np.float64], pattern: NDArray[np.int8]
) -> Identity:
    """Place nodes along single links, if their codes fit and nothing contradicts them.

    Args:
        graph: of the image.
        identity: nodes placed so far.
        logs: (N, 3) evidence.
        pattern: (rows, columns) codes.
    """
    links = graph.loose.chosen(graph.loose.quality >= MIN_QUALITY)
    source = np.concatenate([links.start, links.end])
    target = np.concatenate([links.end, links.start])
    step = identity.turn * np.concatenate([links.step, -links.step])
    for _ in range(ROUNDS):
        placed = identity.placed
        ahead = placed[source] & ~placed[target] & (graph.component[target] < 0)
        wanted = identity.node[source[ahead]] + step[ahead]
        identity = _placed(identity, target[ahead], wanted, logs, pattern)
    return identity


def _placed(
    identity: Identity, target: NDArray[np.intp], wanted: NDArray[np.intp],
    logs: NDArray[np.float64], pattern: NDArray[np.int8],
) -> Identity:  # fmt: skip
    """Place nodes (K,) at columns and rows (K, 2), if free, unopposed and of the right code."""
    inside = ((wanted >= 0) & (wanted < pattern.shape[::-1])).all(1)
    rows = np.unique(np.column_stack([target, wanted])[inside], axis=0)
    target, column, row = rows.T
    fits = logs[target, CODES[0] - pattern[row, column]] >= MIN_EVIDENCE
    taken = np.zeros(pattern.shape, bool)
    taken[identity.node[identity.placed, 1], identity.node[identity.placed, 0]] = True
    flat = row * pattern.shape[1] + column
    # Another wish for the node, or for its place, contradicts this one.
    for wish in (target, flat):
        fits &= np.bincount(wish)[wish] == 1
    fits &= ~taken[row, column]
    placed, node = identity.placed.copy(), identity.node.copy()
    placed[target[fits]] = True
    node[target[fits]] = rows[fits, 1:]
    return replace(identity, placed=placed, node=node)

"""Nodes whose surroundings' codes fit a neighbouring place better are left out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array

from .graph import GridGraph
from .identity import Identity
from .links import Links
from .vote import Placement, scores_at

HOPS = 3
"""Links from a node to the nodes that speak for it: some two dozen inside the grid. Fewer are
outvoted by misreadings, and more by the rest of a part whose border strayed over a fold."""
HERE = (0, 0)


def without_misfits(
    graph: GridGraph,
    identity: Identity,
    logs: NDArray[np.float64],
    pattern: NDArray[np.int8],
    slips: Sequence[tuple[int, int]],
) -> Identity:
    """Take back the places of nodes around which another one explains the codes better.

    A few rows beyond a fold that hang on the grid by wrong links are too few to be cut off, but
    their codes are those of a neighbouring column.

    Args:
        graph: of the image.
        identity: nodes placed so far.
        logs: (N, 3) evidence.
        pattern: (rows, columns) codes.
        slips: columns and rows by which such nodes may be off.
    """
    at = np.flatnonzero(identity.placed)
    if not len(at):
        return identity
    node = identity.node[at]
    links = graph.links.among(at, len(graph.nodes))
    joined = (node[links.end] - node[links.start] == identity.turn * links.step).all(1)
    near = _within_reach(links.chosen(joined), len(at))

    def around(slip: tuple[int, int]) -> NDArray[np.float64]:
        return near @ scores_at(Placement(1, *slip), node, logs[at], pattern)

    elsewhere = np.max([around(slip) for slip in slips if slip != HERE], axis=0)
    placed = identity.placed.copy()
    placed[at[around(HERE) < elsewhere]] = False
    return replace(identity, placed=placed)


def _within_reach(links: Links, count: int) -> csr_array:
    """Return 1 (N, N) for nodes at most HOPS links apart."""
    one = csr_array((np.ones(len(links)), (links.start, links.end)), (count, count))
    one = csr_array(one + one.T + eye_array(count))
    reach = one
    for _ in range(HOPS - 1):
        reach = csr_array(reach @ one)
    reach.data[:] = 1
    return reach

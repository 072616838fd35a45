"""Links between neighbouring nodes, along each of which the phase turns exactly once."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from .heads import Heads
from .nodes import Nodes, larger, wrapped

NEAR = 0.35
"""Periods by which a neighbour may miss its predicted place."""
MAX_TURN_ERROR = 0.2
"""Periods by which the phase's integral along a link may miss its due."""
MAX_EDGE = 0.8
MIN_CONFIDENCE = 0.3
"""Mean along a link: lower than a node's, because a highlight may lie on it."""
POSSIBLE_TURN_ERROR = 0.5
POSSIBLE_CONFIDENCE = 0.15
"""The same limits for links that the graph network judges."""
SAMPLES = 13
STEPS = np.array([[1, 0], [0, 1]])
"""Place in the grid of the neighbour that a link leads to: the right one, the lower one."""


@dataclass(frozen=True, eq=False)
class Links:
    """L links, all from a node to its right or its lower neighbour."""

    start: NDArray[np.intp]
    """(L,) node."""
    end: NDArray[np.intp]
    """(L,) node."""
    axis: NDArray[np.intp]
    """(L,) 0: to the right, 1: downwards."""
    quality: NDArray[np.float64]
    """(L,) from 0 to 1: how well the phase turns, and how surely no depth edge is crossed."""

    def __len__(self) -> int:
        return len(self.start)

    @property
    def step(self) -> NDArray[np.intp]:
        """(L, 2) column and row of the end less those of the start."""
        return STEPS[self.axis]

    def chosen(self, which: NDArray[np.bool_]) -> "Links":
        """Return the links for which ``which`` (L,) holds."""
        return Links(self.start[which], self.end[which], self.axis[which], self.quality[which])

    def among(self, members: NDArray[np.intp], count: int) -> "Links":
        """Return the links between some of ``count`` nodes, numbered by their place among these."""
        number = np.full(count, -1)
        number[members] = np.arange(len(members))
        start, end = number[self.start], number[self.end]
        inside = Links(start, end, self.axis, self.quality)
        return inside.chosen((start >= 0) & (end >= 0))


@dataclass(frozen=True, eq=False)
class Measures:
    """What lies along links."""

    turn_error: NDArray[np.float64]
    """(L, 2) periods by which the phase's integral misses its due; 9 across a jump."""
    edge: NDArray[np.float64]
    """(L,) highest probability of a depth edge."""
    edge_mean: NDArray[np.float64]
    """(L,)"""
    confidence: NDArray[np.float64]
    """(L,) mean."""
    confidence_least: NDArray[np.float64]
    """(L,)"""

    def chosen(self, which: NDArray[np.bool_]) -> "Measures":
        """Return the measures of the links for which ``which`` (L,) holds."""
        return Measures(*(getattr(self, field.name)[which] for field in fields(self)))


def find_links(nodes: Nodes, heads: Heads) -> Links:
    """Return the links of mutual neighbours along which phase, confidence and edges allow it."""
    links = _all_proposed(nodes)
    found = _measured(links, nodes, heads)
    error = larger(found.turn_error)
    good = (error < MAX_TURN_ERROR) & (found.edge < MAX_EDGE)
    good &= found.confidence > MIN_CONFIDENCE
    quality = np.clip((1 - error / MAX_TURN_ERROR) * (1 - found.edge / MAX_EDGE), 0, 1)
    links = replace(links, quality=quality).chosen(good)
    return links.chosen(_best_of_each(links))


def candidate_links(nodes: Nodes, heads: Heads) -> tuple[Links, Measures]:
    """Return links of mutual neighbours that may be real, for the graph network to judge."""
    links = _all_proposed(nodes)
    found = _measured(links, nodes, heads)
    error = larger(found.turn_error)
    possible = (error < POSSIBLE_TURN_ERROR) & (found.confidence > POSSIBLE_CONFIDENCE)
    quality = (1 - error / POSSIBLE_TURN_ERROR) * (1 - found.edge / 2)
    links, found = replace(links, quality=quality).chosen(possible), found.chosen(possible)
    best = _best_of_each(links)
    return links.chosen(best), found.chosen(best)


def _all_proposed(nodes: Nodes) -> Links:
    if len(nodes) < 2:
        none = np.empty(0, np.intp)
        return Links(none, none, none, np.empty(0))
    parts = [_proposed(nodes, step) for step in STEPS]
    start, end = (np.concatenate([p[k] for p in parts]) for k in (0, 1))
    axis = np.repeat([0, 1], [len(p[0]) for p in parts])
    return Links(start, end, axis, np.ones(len(start)))


def _proposed(nodes: Nodes, step: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of nodes of which one lies where the other expects it.

    Not each where the other expects it: the slope at a node beside a depth edge is wrong, and
    whether the pair belongs together is told by the phase between them.
    """
    forward, back = _neighbour(nodes, step), _neighbour(nodes, -step)
    ahead, behind = np.flatnonzero(forward >= 0), np.flatnonzero(back >= 0)
    pairs = np.concatenate([np.column_stack([ahead, forward[ahead]]),
                            np.column_stack([back[behind], behind])])  # fmt: skip
    start, end = np.unique(pairs, axis=0).T
    return start, end


def _best_of_each(links: Links) -> NDArray[np.bool_]:
    """Tell which links (L,) are the best of both their ends in their direction."""
    order = np.lexsort((-links.quality, links.axis))
    best = np.ones(len(links), bool)
    for end in (links.start, links.end):
        pairs = np.column_stack([links.axis, end])[order]
        first = np.zeros(len(links), bool)
        first[np.unique(pairs, axis=0, return_index=True)[1]] = True
        best[order] &= first
    return best


def _neighbour(nodes: Nodes, step: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return for each node (N,) the one nearest to where its neighbour is due; -1 if none."""
    inverse = np.linalg.inv(nodes.slope)
    _, found = cKDTree(nodes.at).query(nodes.at + inverse @ step)
    apart = np.einsum("nij,nj->ni", nodes.slope, nodes.at[found] - nodes.at) - step
    near = (np.abs(apart).max(1) < NEAR) & (found != np.arange(len(nodes)))
    return np.where(near, found, -1)


def _measured(links: Links, nodes: Nodes, heads: Heads) -> Measures:
    """Integrate the phase along the links, and look for depth edges on them."""
    share = np.linspace(0, 1, SAMPLES)[:, None, None]
    path = (1 - share) * nodes.at[links.start] + share * nodes.at[links.end]
    at = path[..., ::-1].transpose(2, 0, 1)
    error = np.abs(_integral(heads.phase, at) - links.step)
    edge, sure = _sample(heads.edge, at), _sample(heads.confidence, at)
    return Measures(error, edge.max(0), edge.mean(0), sure.mean(0), sure.min(0))


def _integral(phase: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turns (L, 2) of the phase along paths ``at`` (2, samples, L), row and column."""
    turns = []
    for axis in (0, 1):
        angle = 2 * np.pi * phase[..., axis]
        sampled = np.arctan2(_sample(np.sin(angle), at), _sample(np.cos(angle), at))
        steps = wrapped(np.diff(sampled / (2 * np.pi), axis=0))
        # Neighbouring samples are a twelfth of a period apart; longer steps are jumps.
        turns.append(np.where(np.abs(steps).max(0) < 0.35, steps.sum(0), np.nan))
    return np.nan_to_num(np.stack(turns, -1), nan=9.0)


def _sample(image: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.asarray(map_coordinates(image, at, order=1, mode="nearest"), np.float32)

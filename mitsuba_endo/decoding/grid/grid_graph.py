"""The grid graph: nodes where both phases are zero, links along which the phase turns once.

Links are kept in closed quads, which confirm each other; each connected component then has one
unknown offset to the pattern.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, minimum_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

from ..network import Heads
from .settings import MatcherSettings

STEPS = np.array([[1, 0], [0, 1]])
"""Column and row of the neighbour that a link leads to: the right one, the lower one."""


@dataclass(frozen=True, eq=False)
class GridNodes:
    """N nodes of an image."""

    at: NDArray[np.float64]
    """(N, 2) image pixels (x, y)."""
    slope: NDArray[np.float64]
    """(N, 2, 2) derivative of the place in the grid (periods) by that in the image (pixels)."""
    code: NDArray[np.float64]
    """(N, 3) probabilities of R, S, L."""

    def __len__(self) -> int:
        return len(self.at)

    @property
    def pixel(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column of each node's pixel."""
        nearest = np.rint(self.at).astype(np.intp)
        return nearest[:, 1], nearest[:, 0]


@dataclass(frozen=True, eq=False)
class GridLinks:
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

    def chosen(self, which: NDArray[np.bool_]) -> "GridLinks":
        """Return the links for which ``which`` (L,) holds."""
        return GridLinks(self.start[which], self.end[which], self.axis[which], self.quality[which])

    def among(self, members: NDArray[np.intp], count: int) -> "GridLinks":
        """Return the links between some of ``count`` nodes, numbered by their rank among these."""
        number = np.full(count, -1)
        number[members] = np.arange(len(members))
        start, end = number[self.start], number[self.end]
        inside = GridLinks(start, end, self.axis, self.quality)
        return inside.chosen((start >= 0) & (end >= 0))


@dataclass(frozen=True, eq=False)
class GridGraph:
    """Nodes and links of an image; each component has one unknown offset to the pattern."""

    nodes: GridNodes
    links: GridLinks
    single: GridLinks
    """Links in no closed quad: they join no component."""
    component: NDArray[np.intp]
    """(N,) number of the node's component, -1 for nodes without links."""
    index: NDArray[np.intp]
    """(N, 2) column and row relative to an arbitrary node of the component."""


def wrapped(periods: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the values modulo one, in [-1/2, 1/2]."""
    return periods - np.rint(periods)


def larger(pairs: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the larger absolute value of pairs (..., 2).

    NumPy reduces a last axis of length two far more slowly.
    """
    return np.maximum(np.abs(pairs[..., 0]), np.abs(pairs[..., 1]))


def build_graph(heads: Heads, settings: MatcherSettings) -> GridGraph:
    """Return the graph of an image."""
    nodes = find_nodes(heads, settings)
    return graph_of(nodes, find_links(nodes, heads, settings))


def graph_of(nodes: GridNodes, links: GridLinks) -> GridGraph:
    """Return the graph of nodes and links."""
    closed = _quads(links, len(nodes)) > 0
    links, single = links.chosen(closed), links.chosen(~closed)
    component = components(links, len(nodes))
    index = _indices(links, component)
    fits = (index[links.end] - index[links.start] == links.step).all(1)
    # A component that closes only by links that contradict each other loses them.
    return GridGraph(nodes, links.chosen(fits), single, component, index)


def find_nodes(heads: Heads, settings: MatcherSettings) -> GridNodes:
    """Return the zeros of both phases where the network is confident.

    Each pixel takes one Newton step with the slope around it; where the step stays within the
    pixel, it ends at a node.
    """
    phase = heads.phase
    slope = phase_slope(phase)
    inverse, regular = _inverse(slope, *settings.period_range)
    step = -np.einsum("hwij,hwj->hwi", inverse, phase)
    size = larger(step)
    good = regular & (heads.confidence > settings.node_confidence)
    size = np.where(good & (larger(phase) < settings.node_phase), size, np.inf)
    best = size == minimum_filter(size, settings.node_spacing)
    y, x = np.nonzero((size <= settings.node_reach) & best)
    shape = np.array(size.shape[::-1])
    at = np.clip(np.stack([x, y], -1) + step[y, x], 0, shape - 1)
    code = cv2.blur(heads.code.transpose(1, 2, 0), (3, 3))
    return GridNodes(at, slope[y, x].astype(np.float64), code[y, x].astype(np.float64))


def phase_slope(phase: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the derivative (H, W, 2, 2) of the wrapped phase by x and y, averaged over 5 x 5."""
    padded = np.pad(phase, ((1, 1), (1, 1), (0, 0)), mode="edge")
    by_x = wrapped(padded[1:-1, 2:] - padded[1:-1, :-2]) / 2
    by_y = wrapped(padded[2:, 1:-1] - padded[:-2, 1:-1]) / 2
    mean = [cv2.blur(np.ascontiguousarray(d, np.float32), (5, 5)) for d in (by_x, by_y)]
    return np.stack(mean, -1).astype(np.float32)


def _inverse(
    slope: NDArray[np.float32], shortest: float, longest: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the inverse (H, W, 2, 2), pixels per period, and where it is that of a grid.

    A surface is seen from its lit side, so the image never shows the grid mirrored.
    """
    a, b, c, d = (slope[..., i, j] for i in (0, 1) for j in (0, 1))
    determinant = a * d - b * c
    regular = determinant > 1 / longest**2
    safe = np.where(regular, determinant, 1)
    inverse = np.stack([d, -b, -c, a], -1).reshape(*slope.shape) / safe[..., None, None]
    for period in (np.hypot(inverse[..., 0, k], inverse[..., 1, k]) for k in (0, 1)):
        regular &= (period > shortest) & (period < longest)
    return inverse.astype(np.float32), regular


def find_links(nodes: GridNodes, heads: Heads, settings: MatcherSettings) -> GridLinks:
    """Return the links of mutual neighbours along which phase, confidence and edges allow it."""
    if len(nodes) < 2:
        none = np.empty(0, np.intp)
        return GridLinks(none, none, none, np.empty(0))
    pairs = [_proposed_pairs(nodes, step, settings.link_reach) for step in STEPS]
    start, end = np.concatenate(pairs).T
    axis = np.repeat([0, 1], [len(pair) for pair in pairs])
    share = np.linspace(0, 1, settings.link_samples)[:, None, None]
    path = (1 - share) * nodes.at[start] + share * nodes.at[end]
    at = path[..., ::-1].transpose(2, 0, 1)
    error = larger(np.abs(_turns(heads.phase, at, settings.link_jump) - STEPS[axis]))
    edge, confidence = _sample(heads.edge, at).max(0), _sample(heads.confidence, at).mean(0)
    good = (error < settings.link_phase_error) & (edge < settings.link_edge)
    good &= confidence > settings.link_confidence
    quality = (1 - error / settings.link_phase_error) * (1 - edge / settings.link_edge)
    links = GridLinks(start, end, axis, np.clip(quality, 0, 1)).chosen(good)
    return links.chosen(_best_of_each(links))


def _proposed_pairs(
    nodes: GridNodes, step: NDArray[np.intp], reach: float
) -> NDArray[np.intp]:  # fmt: skip
    """Return pairs (P, 2) of nodes of which one lies where the other expects it.

    Not each where the other expects it: the slope at a node beside a depth edge is wrong, and
    whether the pair belongs together is told by the phase between them.
    """
    forward, back = _neighbour(nodes, step, reach), _neighbour(nodes, -step, reach)
    ahead, behind = np.flatnonzero(forward >= 0), np.flatnonzero(back >= 0)
    pairs = np.concatenate([np.column_stack([ahead, forward[ahead]]),
                            np.column_stack([back[behind], behind])])  # fmt: skip
    return np.unique(pairs, axis=0)


def _neighbour(nodes: GridNodes, step: NDArray[np.intp], reach: float) -> NDArray[np.intp]:
    """Return for each node (N,) the one nearest to where its neighbour is due; -1 if none."""
    inverse = np.linalg.inv(nodes.slope)
    _, nearest = cKDTree(nodes.at).query(nodes.at + inverse @ step)
    apart = np.einsum("nij,nj->ni", nodes.slope, nodes.at[nearest] - nodes.at) - step
    near = (np.abs(apart).max(1) < reach) & (nearest != np.arange(len(nodes)))
    return np.where(near, nearest, -1)


def _best_of_each(links: GridLinks) -> NDArray[np.bool_]:
    """Tell which links (L,) are the best of both their ends in their direction."""
    order = np.lexsort((-links.quality, links.axis))
    best = np.ones(len(links), bool)
    for end in (links.start, links.end):
        pairs = np.column_stack([links.axis, end])[order]
        first = np.zeros(len(links), bool)
        first[np.unique(pairs, axis=0, return_index=True)[1]] = True
        best[order] &= first
    return best


def _turns(
    phase: NDArray[np.float32], at: NDArray[np.float64], jump: float
) -> NDArray[np.float64]:  # fmt: skip
    """Return the turns (L, 2) of the phase along paths ``at`` (2, samples, L), row and column.

    Across a jump they are 9.
    """
    turns = []
    for axis in (0, 1):
        angle = 2 * np.pi * phase[..., axis]
        sampled = np.arctan2(_sample(np.sin(angle), at), _sample(np.cos(angle), at))
        steps = wrapped(np.diff(sampled / (2 * np.pi), axis=0))
        turns.append(np.where(np.abs(steps).max(0) < jump, steps.sum(0), np.nan))
    return np.nan_to_num(np.stack(turns, -1), nan=9.0)


def _sample(image: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.asarray(map_coordinates(image, at, order=1, mode="nearest"), np.float32)


def _quads(links: GridLinks, count: int) -> NDArray[np.intp]:
    """Return how many closed quads each link (L,) belongs to, of a graph of ``count`` nodes."""
    to = np.full((2, count + 1), count)
    number = np.full((2, count + 1), len(links))
    to[links.axis, links.start] = links.end
    number[links.axis, links.start] = np.arange(len(links))
    right, down = to
    corner = np.flatnonzero((right[down] == down[right]) & (right[down] < count))
    used = np.zeros(len(links) + 1, np.intp)
    for axis, start in ((0, corner), (1, corner), (0, down[corner]), (1, right[corner])):
        np.add.at(used, number[axis, start], 1)
    return used[:-1]


def components(links: GridLinks, count: int) -> NDArray[np.intp]:
    """Return the number of the connected component of each node (N,), -1 for those alone."""
    matrix = coo_array((np.ones(len(links)), (links.start, links.end)), shape=(count, count))
    number = connected_components(matrix, directed=False)[1].astype(np.intp)
    linked = np.zeros(count, bool)
    linked[links.start] = linked[links.end] = True
    return np.where(linked, number, -1)


def _indices(links: GridLinks, component: NDArray[np.intp]) -> NDArray[np.intp]:
    """Add up the steps along a spanning tree of the best links."""
    shape = (len(component), len(component))
    cost = coo_array((1.01 - links.quality, (links.start, links.end)), shape=shape)
    tree = minimum_spanning_tree(cost.tocsr())
    pairs = zip(links.start.tolist(), links.end.tolist(), strict=True)
    forward = dict(zip(pairs, links.step, strict=True))
    step = {}
    for a, b in zip(*(ends.tolist() for ends in tree.tocoo().coords), strict=True):
        step[a, b], step[b, a] = forward[a, b], -forward[a, b]
    index = np.zeros((len(component), 2), np.intp)
    for number in np.unique(component[component >= 0]):
        root = int(np.flatnonzero(component == number)[0])
        order, before = breadth_first_order(tree, root, directed=False)
        for node in order[1:].tolist():
            index[node] = index[before[node]] + step[int(before[node]), node]
    return index

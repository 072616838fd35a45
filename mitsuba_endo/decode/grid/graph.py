"""The grid graph: links in closed quads, connected components, and places within them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from .heads import Heads
from .links import Links, find_links
from .nodes import Nodes, find_nodes
from .quads import quads


@dataclass(frozen=True, eq=False)
class GridGraph:
    """Nodes and links of an image; each component has one unknown place in the pattern."""

    nodes: Nodes
    links: Links
    loose: Links
    """Links in no closed quad: they join no component."""
    component: NDArray[np.intp]
    """(N,) number of the node's component, -1 for nodes without links."""
    place: NDArray[np.intp]
    """(N, 2) column and row relative to an arbitrary node of the component."""


def build_graph(heads: Heads) -> GridGraph:
    """Return the graph of an image."""
    nodes = find_nodes(heads)
    return graph_of(nodes, find_links(nodes, heads))


def graph_of(nodes: Nodes, links: Links) -> GridGraph:
    """Return the graph of nodes and links."""
    closed = quads(links, len(nodes)) > 0
    links, loose = links.chosen(closed), links.chosen(~closed)
    component = components(links, len(nodes))
    place = _places(links, component)
    fits = (place[links.end] - place[links.start] == links.step).all(1)
    # A component that closes only by links that contradict each other loses them.
    return GridGraph(nodes, links.chosen(fits), loose, component, place)


def components(links: Links, count: int) -> NDArray[np.intp]:
    """Return the number of the connected component of each node (N,), -1 for those alone."""
    matrix = coo_array((np.ones(len(links)), (links.start, links.end)), shape=(count, count))
    number = connected_components(matrix, directed=False)[1].astype(np.intp)
    linked = np.zeros(count, bool)
    linked[links.start] = linked[links.end] = True
    return np.where(linked, number, -1)


def _places(links: Links, component: NDArray[np.intp]) -> NDArray[np.intp]:
    """Add up the steps along a spanning tree of the best links."""
    count = len(component)
    cost = 1.01 - links.quality
    tree = minimum_spanning_tree(
        coo_array((cost, (links.start, links.end)), shape=(count, count)).tocsr()
    ).tocoo()
    step = {}
    known = {(int(a), int(b)): tuple(s) for a, b, s in zip(links.start, links.end, links.step,
                                                          strict=True)}  # fmt: skip
    for a, b in zip(tree.row.tolist(), tree.col.tolist(), strict=True):
        x, y = known[a, b]
        step[a, b], step[b, a] = (x, y), (-x, -y)
    place = np.zeros((count, 2), np.intp)
    graph = tree.tocsr()
    for number in np.unique(component[component >= 0]):
        root = int(np.flatnonzero(component == number)[0])
        order, before = breadth_first_order(graph, root, directed=False)
        for node in order[1:]:
            place[node] = place[before[node]] + step[int(before[node]), int(node)]
    return place

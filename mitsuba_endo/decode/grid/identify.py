"""Which node of the pattern each node of the graph is, or that it cannot be told."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .beside import vote_beside
from .graph import GridGraph, components
from .identity import Identity
from .pendants import with_pendants
from .potts import cut
from .surroundings import without_misfits
from .vote import Placement, Vote, evidence, scores_at, vote
from .windows import candidates

MIN_NODES = 9
"""Of a part that is placed."""
MIN_SCORE = 0.3
"""Mean evidence of a placed part's nodes, if all of it is less than SURE."""
SURE = 12.0
"""Evidence, and margin, that chance hardly gives: one placement has evidence s by chance with
probability exp(-s) at most (Markov's inequality for likelihood ratios), of some 6,000."""
SLIPS = [(dx, dy) for dx in range(-3, 4) for dy in (-1, 0, 1)]
"""Columns and rows by which the other side of a fold is often off."""
MIN_MARGIN = 6.0
"""Evidence of a placed part over its next best placement."""
MIN_SHARE = 0.4
"""Of a component's nodes that must be placed, or else the whole of it is refused: the cut finds
a few windows that fit in any grid, also in one with another code."""
MIN_SHARE_OF_ALL = 0.25
"""Of all components' nodes that must be placed, likewise: of many small components in a grid with
another code, one or two fit by chance as a whole."""
LARGE_PART = 60
"""Nodes of a part that speaks for itself."""
LINK_COST = 2.0
"""Price, in evidence, of a link between two placements."""
WEAKEST = 0.2
"""Share of that price for the worst link."""
LEAST = 0.1
"""Evidence a node, under which a part is left out although links lead there: right parts of badly
corrupted images have about 0.3, chance gives less than 0."""


@dataclass(frozen=True, eq=False)
class _Part:
    members: NDArray[np.intp]
    """Nodes of one part of a component."""
    placement: Placement
    score: float
    component: int


def identify(graph: GridGraph, pattern: NDArray[np.int8]) -> Identity:
    """Identify the nodes by their codes, component by component.

    Args:
        graph: of the image.
        pattern: (rows, columns) codes.
    """
    logs = evidence(graph.nodes.code)
    parts: list[_Part] = []
    tried = 0
    for number in np.unique(graph.component[graph.component >= 0]):
        members = np.flatnonzero(graph.component == number)
        if len(members) >= MIN_NODES:
            tried += len(members)
            found = _parts(graph, members, logs, pattern)
            parts += _accepted(found, MIN_SHARE * len(members))
    parts = _accepted(_same_way_up(parts), MIN_SHARE_OF_ALL * tried)
    parts += _beside(graph, parts, logs, pattern)
    identity = _without_doubles(graph, parts, logs, pattern)
    identity = without_misfits(graph, identity, logs, pattern, SLIPS)
    return with_pendants(graph, identity, logs, pattern)


def _parts(
    graph: GridGraph,
    members: NDArray[np.intp],
    logs: NDArray[np.float64],
    pattern: NDArray[np.int8],
) -> list[_Part]:
    """Cut a component where two placements meet, and vote again within the parts."""
    place, known = graph.place[members], logs[members]
    whole = vote(place, known, pattern)
    found = [whole.best, *candidates(place, known, pattern)]
    labels = list(dict.fromkeys([*found, *(whole.best.shifted(*slip) for slip in SLIPS)]))
    cost = np.stack([-scores_at(label, place, known, pattern) for label in labels], -1)
    # The last label stands for "none of them", at little more than the evidence of chance.
    cost = np.concatenate([cost, np.full((len(members), 1), -LEAST)], axis=1)
    links = graph.links.among(members, len(graph.nodes))
    price = LINK_COST * (WEAKEST + (1 - WEAKEST) * links.quality)
    label = cut(cost, links.start, links.end, price)
    same = links.chosen(
        (label[links.start] == label[links.end]) & (label[links.start] < len(labels))
    )
    number = components(same, len(members))
    component = int(graph.component[members[0]])
    parts = []
    for part in np.unique(number[number >= 0]):
        inside = np.flatnonzero(number == part)
        if len(inside) < MIN_NODES:
            continue
        again = vote(place[inside], known[inside], pattern)
        if _convincing(again, len(inside)):
            parts.append(_Part(members[inside], again.best, again.score, component))
    return parts


def _convincing(found: Vote, nodes: int) -> bool:
    well_read = found.score >= MIN_SCORE * nodes and found.margin >= MIN_MARGIN
    return well_read or min(found.score, found.margin) >= SURE


def _accepted(parts: list[_Part], needed: float) -> list[_Part]:
    """Refuse parts that hold fewer nodes than needed, unless one of them is large."""
    placed = [len(part.members) for part in parts]
    enough = sum(placed) >= needed or max(placed, default=0) >= LARGE_PART
    return parts if enough else []


def _beside(
    graph: GridGraph, parts: list[_Part], logs: NDArray[np.float64], pattern: NDArray[np.int8]
) -> list[_Part]:
    """Place components that are too small or too badly read to be placed alone."""
    if not parts:
        return []
    placed = np.concatenate([part.members for part in parts])
    known = np.concatenate([part.placement.of(graph.place[part.members]) for part in parts])
    turn, done = parts[0].placement.turn, {part.component for part in parts}
    found = []
    for number in set(graph.component[graph.component >= 0].tolist()) - done:
        members = np.flatnonzero(graph.component == number)
        again = vote_beside(members, placed, known, graph.nodes, graph.place, logs, pattern, turn,
                           SLIPS)  # fmt: skip
        if again is not None:
            found.append(_Part(members, again.best, again.score, number))
    return found


def _same_way_up(parts: list[_Part]) -> list[_Part]:
    """Keep the parts that agree on which way up the pattern is seen."""
    upright = sum(part.placement.turn * part.score for part in parts)
    return [part for part in parts if part.placement.turn * upright > 0]


def _without_doubles(
    graph: GridGraph, parts: list[_Part], logs: NDArray[np.float64], pattern: NDArray[np.int8]
) -> Identity:
    """Give each node of the pattern to one node of the image: a ray meets one lit point.

    The part with more evidence keeps it; nodes of the same part that claim it both lose it.
    """
    placed = np.zeros(len(graph.nodes), bool)
    node = np.full((len(graph.nodes), 2), -1)
    taken = np.zeros(pattern.shape, bool)
    for part in sorted(parts, key=lambda part: -part.score):
        at = part.placement.of(graph.place[part.members])
        inside = ((at >= 0) & (at < pattern.shape[::-1])).all(1)
        at, members = at[inside], part.members[inside]
        flat = at[:, 1] * pattern.shape[1] + at[:, 0]
        once = np.bincount(flat, minlength=pattern.size)[flat] == 1
        free = once & ~taken.ravel()[flat]
        placed[members[free]] = True
        node[members[free]] = at[free]
        taken.ravel()[flat] = True
    read = np.argmax(logs[placed], -1) == 1 - pattern[node[placed, 1], node[placed, 0]]
    turn = parts[0].placement.turn if parts else 1
    return Identity(placed, node, turn, float(read.mean()) if placed.any() else 0.0)

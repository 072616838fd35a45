"""Node assignment: which node of the pattern each node of the graph is, or that it cannot be told.

A component across a fold holds parts with several offsets to the pattern: it is cut where their
codes say so. What is off by whole periods, or fits by chance, is refused.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array
from scipy.spatial import cKDTree

from .code_matching import CodeMatcher, OffsetVote, PatternOffset, potts_labels
from .grid_graph import GridGraph, components
from .settings import MatcherSettings


@dataclass(frozen=True, eq=False)
class NodeAssignment:
    """Which nodes of an image are which nodes of the pattern."""

    assigned: NDArray[np.bool_]
    """(N,) nodes that were identified."""
    node: NDArray[np.intp]
    """(N, 2) column and row in the pattern, -1 where not assigned."""
    turn: int
    """1 if the pattern is seen upright, -1 upside down."""
    codes_right: float
    """Share of the assigned nodes whose most probable code is the pattern's, 0 if none."""


@dataclass(frozen=True, eq=False)
class _Part:
    members: NDArray[np.intp]
    """Nodes of one part of a component."""
    offset: PatternOffset
    evidence: float
    component: int


def assign_nodes(
    graph: GridGraph, code: NDArray[np.int8], settings: MatcherSettings
) -> NodeAssignment:
    """Assign nodes by their codes, component by component.

    Args:
        graph: of the image.
        code: (rows, columns) of the pattern.
        settings: thresholds.
    """
    matcher = CodeMatcher.of(graph.nodes.code, code, settings)
    parts: list[_Part] = []
    tried = 0
    for number in _component_numbers(graph):
        members = np.flatnonzero(graph.component == number)
        if len(members) >= settings.part_nodes:
            tried += len(members)
            share = settings.component_share * len(members)
            parts += _if_enough(_parts(graph, members, matcher), share, settings)
    parts = _if_enough(_same_way_up(parts), settings.total_share * tried, settings)
    parts += _small_components(graph, parts, matcher)
    assignment = _without_doubles(graph, parts, matcher)
    assignment = reject_period_errors(graph, assignment, matcher)
    return assign_by_single_links(graph, assignment, matcher)


def _component_numbers(graph: GridGraph) -> list[int]:
    return np.unique(graph.component[graph.component >= 0]).tolist()


def _parts(graph: GridGraph, members: NDArray[np.intp], matcher: CodeMatcher) -> list[_Part]:
    """Cut a component where two offsets meet, and vote again within the parts."""
    index, settings = graph.index[members], matcher.settings
    inside = matcher.among(members)
    links = graph.links.among(members, len(graph.nodes))
    offsets = _possible_offsets(inside, index)
    cost = np.stack([-inside.at(offset.of(index)) for offset in offsets], -1)
    # The last label stands for "none of them", at little more than the evidence of chance.
    none = np.full((len(members), 1), -settings.chance_evidence)
    least = settings.cut_least
    price = settings.cut_evidence * (least + (1 - least) * links.quality)
    label = potts_labels(
        np.concatenate([cost, none], axis=1), (links.start, links.end), price,
        rounds=settings.cut_rounds, damping=settings.cut_damping,
    )  # fmt: skip
    together = (label[links.start] == label[links.end]) & (label[links.start] < len(offsets))
    number = components(links.chosen(together), len(members))
    component = int(graph.component[members[0]])
    parts = []
    for part in (np.flatnonzero(number == n) for n in np.unique(number[number >= 0])):
        if len(part) >= settings.part_nodes:
            vote = inside.among(part).vote(index[part])
            if _convincing(vote, len(part), settings):
                parts.append(_Part(members[part], vote.best, vote.evidence, component))
    return parts


def _possible_offsets(matcher: CodeMatcher, index: NDArray[np.intp]) -> list[PatternOffset]:
    """Return the offset of all nodes, those of windows, and those a few periods off, once each."""
    whole = matcher.vote(index).best
    shifted = (whole.shifted(*error) for error in matcher.settings.offset_errors())
    return list(dict.fromkeys([whole, *matcher.window_offsets(index), *shifted]))


def _convincing(vote: OffsetVote, nodes: int, settings: MatcherSettings) -> bool:
    well_read = vote.evidence >= settings.part_evidence * nodes
    certain = min(vote.evidence, vote.margin) >= settings.certain
    return certain or (well_read and vote.margin >= settings.part_margin)


def _if_enough(parts: list[_Part], needed: float, settings: MatcherSettings) -> list[_Part]:
    """Refuse parts that hold fewer nodes than needed, unless one of them is large.

    The cut finds a few windows that fit in any grid, also in one with another code.
    """
    sizes = [len(part.members) for part in parts]
    enough = sum(sizes) >= needed or max(sizes, default=0) >= settings.large_part
    return parts if enough else []


def _same_way_up(parts: list[_Part]) -> list[_Part]:
    """Keep the parts that agree on which way up the pattern is seen."""
    upright = sum(part.offset.turn * part.evidence for part in parts)
    return [part for part in parts if part.offset.turn * upright > 0]


def _small_components(
    graph: GridGraph, parts: list[_Part], matcher: CodeMatcher
) -> list[_Part]:  # fmt: skip
    """Assign components that are too small or too badly read alone, by the nodes near them."""
    if not parts:
        return []
    assigned = np.concatenate([part.members for part in parts])
    node = np.concatenate([part.offset.of(graph.index[part.members]) for part in parts])
    turn, done = parts[0].offset.turn, {part.component for part in parts}
    small = []
    for number in set(_component_numbers(graph)) - done:
        members = np.flatnonzero(graph.component == number)
        offsets = _predicted_offsets(graph, members, assigned, node, turn, matcher.settings)
        best = _best_offset(offsets, graph.index[members], matcher.among(members))
        if best is not None:
            small.append(_Part(members, *best, number))
    return small


def _predicted_offsets(
    graph: GridGraph,
    members: NDArray[np.intp],
    assigned: NDArray[np.intp],
    node: NDArray[np.intp],
    turn: int,
    settings: MatcherSettings,
) -> set[PatternOffset]:
    """Return the offsets of a component that assigned nodes near it allow.

    A surface that runs on gives the column and row of a node from those of a node nearby; a fold
    between them shifts it by a few columns.

    Args:
        graph: of the image.
        members: (M,) nodes of the component.
        assigned: (P,) nodes that are assigned already.
        node: (P, 2) their columns and rows in the pattern.
        turn: of the assigned nodes.
        settings: thresholds.
    """
    at, index = graph.nodes.at, graph.index
    _, nearest = cKDTree(at[assigned]).query(at[members])
    away = at[members] - at[assigned[nearest]]
    moved = np.einsum("nij,nj->ni", graph.nodes.slope[assigned[nearest]], away)
    close = np.abs(moved).max(1) < settings.near_periods
    predicted = node[nearest] + turn * np.rint(moved).astype(np.intp)
    offsets = np.unique((predicted - turn * index[members])[close], axis=0).tolist()
    return {
        PatternOffset(turn, x, y).shifted(*error)
        for x, y in offsets
        for error in settings.offset_errors()
    }


def _best_offset(
    offsets: Iterable[PatternOffset], index: NDArray[np.intp], matcher: CodeMatcher
) -> tuple[PatternOffset, float] | None:
    """Return the offset with most evidence, and that, if it is enough and clear."""
    settings = matcher.settings
    ranked = sorted((float(matcher.at(offset.of(index)).sum()), offset) for offset in offsets)
    if len(ranked) < 2:
        return None
    (second, _), (evidence, best) = ranked[-2:]
    enough = evidence >= max(settings.near_margin, settings.near_evidence * len(index))
    return (best, evidence) if enough and evidence - second >= settings.near_margin else None


def _without_doubles(
    graph: GridGraph, parts: list[_Part], matcher: CodeMatcher
) -> NodeAssignment:  # fmt: skip
    """Give each node of the pattern to one node of the image: a ray meets one lit point.

    The part with more evidence keeps it; nodes of the same part that claim it both lose it.
    """
    code = matcher.code
    assigned = np.zeros(len(graph.nodes), bool)
    node = np.full((len(graph.nodes), 2), -1)
    taken = np.zeros(code.size, bool)
    for part in sorted(parts, key=lambda part: -part.evidence):
        claimed = part.offset.of(graph.index[part.members])
        inside = matcher.inside(claimed)
        claimed, members = claimed[inside], part.members[inside]
        flat = claimed[:, 1] * code.shape[1] + claimed[:, 0]
        free = (np.bincount(flat, minlength=code.size)[flat] == 1) & ~taken[flat]
        assigned[members[free]] = True
        node[members[free]] = claimed[free]
        taken[flat] = True
    right = np.argmax(matcher.read[assigned], -1) == 1 - code[node[assigned, 1], node[assigned, 0]]
    turn = parts[0].offset.turn if parts else 1
    return NodeAssignment(assigned, node, turn, float(right.mean()) if assigned.any() else 0.0)


def reject_period_errors(
    graph: GridGraph, assignment: NodeAssignment, matcher: CodeMatcher
) -> NodeAssignment:
    """Take back nodes around which an offset some periods off explains the codes better.

    A few rows beyond a fold that hang on the grid by wrong links are too few to be cut off, but
    their codes are those of a neighbouring column.
    """
    at = np.flatnonzero(assignment.assigned)
    if not len(at):
        return assignment
    node = assignment.node[at]
    links = graph.links.among(at, len(graph.nodes))
    joined = (node[links.end] - node[links.start] == assignment.turn * links.step).all(1)
    links, inside = links.chosen(joined), matcher.among(at)
    one = csr_array((np.ones(len(links)), (links.start, links.end)), (len(at), len(at)))
    one = csr_array(one + one.T + eye_array(len(at)))
    near = one
    for _ in range(matcher.settings.context_links - 1):
        near = csr_array(near @ one)
    near.data[:] = 1
    errors = matcher.settings.offset_errors()
    around = {error: near @ inside.at(node + np.array(error)) for error in errors}
    here = around.pop((0, 0))
    assigned = assignment.assigned.copy()
    assigned[at[here < np.max(list(around.values()), axis=0, initial=-np.inf)]] = False
    return replace(assignment, assigned=assigned)


def assign_by_single_links(
    graph: GridGraph, assignment: NodeAssignment, matcher: CodeMatcher
) -> NodeAssignment:
    """Assign nodes in no closed quad, if their codes fit and nothing contradicts them."""
    links = graph.single.chosen(graph.single.quality >= matcher.settings.single_quality)
    source = np.concatenate([links.start, links.end])
    target = np.concatenate([links.end, links.start])
    step = assignment.turn * np.concatenate([links.step, -links.step])
    for _ in range(matcher.settings.single_links):
        assigned = assignment.assigned
        ahead = assigned[source] & ~assigned[target] & (graph.component[target] < 0)
        claimed = assignment.node[source[ahead]] + step[ahead]
        assignment = _with_claims(assignment, target[ahead], claimed, matcher)
    return assignment


def _with_claims(
    assignment: NodeAssignment,
    target: NDArray[np.intp],
    claimed: NDArray[np.intp],
    matcher: CodeMatcher,
) -> NodeAssignment:
    """Assign nodes (K,) to columns and rows (K, 2), if free, unopposed and of the right code."""
    rows = np.unique(np.column_stack([target, claimed])[matcher.inside(claimed)], axis=0)
    target, claimed = rows[:, 0], rows[:, 1:]
    width, taken = matcher.code.shape[1], assignment.node[assignment.assigned]
    flat = claimed[:, 1] * width + claimed[:, 0]
    fits = matcher.among(target).at(claimed) >= matcher.settings.single_evidence
    # Another claim of the node, or of its place, contradicts this one.
    for claim in (target, flat):
        fits &= np.bincount(claim)[claim] == 1
    fits &= ~np.isin(flat, taken[:, 1] * width + taken[:, 0])
    assigned, node = assignment.assigned.copy(), assignment.node.copy()
    assigned[target[fits]] = True
    node[target[fits]] = claimed[fits]
    return replace(assignment, assigned=assigned, node=node)

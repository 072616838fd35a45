"""Nodes that a single link joins to assigned ones, in a graph drawn by hand."""

import numpy as np

from mitsuba_endo.decoding.gap_code import gap_code
from mitsuba_endo.decoding.grid.code_matching import CodeMatcher
from mitsuba_endo.decoding.grid.decode import DEFAULTS, DecodedGrid
from mitsuba_endo.decoding.grid.grid_graph import GridGraph, GridLinks, GridNodes
from mitsuba_endo.decoding.grid.node_assignment import NodeAssignment, assign_by_single_links

PATTERN = gap_code(12, 10)
TRUE = np.array([[4, 5], [5, 5], [4, 6], [5, 6], [6, 6], [7, 6], [4, 7]])
"""Column and row: a quad, two nodes in a row to the right of it, one below it."""
QUAD = 4
SINGLE = np.array([[3, 4, 0], [4, 5, 0], [2, 6, 1]])
"""Start, end, axis."""


def decoded(misread: int | None = None, quality: float = 0.9, turn: int = 1) -> DecodedGrid:
    """Return what is assigned, where one node's code may be misread; no pixels."""
    true = TRUE if turn == 1 else np.array(PATTERN.shape[::-1]) - 1 - TRUE
    code = 1 - PATTERN[true[:, 1], true[:, 0]]
    if misread is not None:
        code[misread] = (code[misread] + 1) % 3
    probable = np.full((len(TRUE), 3), 0.05)
    probable[np.arange(len(TRUE)), code] = 0.9
    nodes = GridNodes(10.0 * TRUE, np.tile(np.eye(2) / 10, (len(TRUE), 1, 1)), probable)
    start, end, axis = SINGLE.T
    single = GridLinks(start, end, axis, np.full(len(SINGLE), quality))
    none = single.chosen(np.zeros(len(single), bool))
    inside = np.arange(len(TRUE)) < QUAD
    graph = GridGraph(nodes, none, single, np.where(inside, 0, -1), TRUE)
    quad = NodeAssignment(inside, np.where(inside[:, None], true, -1), turn, 1.0)
    matcher = CodeMatcher.of(probable, PATTERN, DEFAULTS)
    longer = assign_by_single_links(graph, quad, matcher)
    return DecodedGrid(np.zeros((0, 0, 2)), np.zeros((0, 0)), graph, longer, "")


def assignment(misread: int | None = None, quality: float = 0.9, turn: int = 1) -> NodeAssignment:
    return decoded(misread, quality, turn).assignment


def test_right_codes():
    """Oracle: the places by which the codes were written, upright and upside down."""
    for turn in (1, -1):
        longer = assignment(turn=turn)
        assert longer.assigned.all()
        true = TRUE if turn == 1 else np.array(PATTERN.shape[::-1]) - 1 - TRUE
        np.testing.assert_array_equal(longer.node, true)


def test_a_wrong_code_ends_the_chain():
    """Oracle: by hand; the node behind the misread one is reached by no other link."""
    np.testing.assert_array_equal(assignment(misread=4).assigned, [1, 1, 1, 1, 0, 0, 1])


def test_poor_links_lead_nowhere():
    """Oracle: by hand."""
    np.testing.assert_array_equal(assignment(quality=0.3).assigned, np.arange(7) < QUAD)


def test_all_that_are_assigned_are_counted():
    """Oracle: by hand; more nodes than were found cannot be identified."""
    assert decoded().nodes == 7
    assert decoded(misread=4).nodes == QUAD + 1

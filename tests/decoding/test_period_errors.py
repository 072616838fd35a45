"""Strips of nodes that wrong links joined to a grid, in a graph drawn by hand."""

import numpy as np
import pytest

from mitsuba_endo.decoding.gap_code import gap_code
from mitsuba_endo.decoding.grid.code_matching import CodeMatcher
from mitsuba_endo.decoding.grid.decode import DEFAULTS
from mitsuba_endo.decoding.grid.grid_graph import GridGraph, GridLinks, GridNodes, graph_of
from mitsuba_endo.decoding.grid.node_assignment import NodeAssignment, reject_period_errors

PATTERN = gap_code(20, 18)
COLUMNS, ROWS = 9, 8
FIRST = np.array([5, 6])
"""Column and row in the pattern of the first node."""


def grid(strayed: np.ndarray, sure: float, turn: int = 1) -> tuple[GridGraph, NodeAssignment]:
    """Return a grid of nodes of which some show the codes one column further."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    place = np.stack([x, y], -1)
    node = FIRST + place if turn == 1 else np.array(PATTERN.shape[::-1]) - 1 - FIRST - place
    shown = node + np.where(strayed[:, None], [1, 0], 0)
    code = np.full((len(place), 3), (1 - sure) / 2)
    code[np.arange(len(place)), 1 - PATTERN[shown[:, 1], shown[:, 0]]] = sure
    nodes = GridNodes(10.0 * place, np.tile(np.eye(2) / 10, (len(place), 1, 1)), code)
    right, below = np.flatnonzero(x < COLUMNS - 1), np.flatnonzero(y < ROWS - 1)
    start, end = np.concatenate([right, below]), np.concatenate([right + 1, below + COLUMNS])
    axis = np.repeat([0, 1], [len(right), len(below)])
    links = GridLinks(start, end, axis, np.full(len(start), 0.9))
    return graph_of(nodes, links), NodeAssignment(np.ones(len(place), bool), node, turn, 1.0)


def kept(graph: GridGraph, assignment: NodeAssignment) -> np.ndarray:
    matcher = CodeMatcher.of(graph.nodes.code, PATTERN, DEFAULTS)
    return reject_period_errors(graph, assignment, matcher).assigned


@pytest.mark.parametrize("turn", [1, -1])
def test_right_codes_stay(turn: int):
    """Oracle: nothing speaks against a node, even where one in three is hardly read."""
    graph, assignment = grid(np.zeros(COLUMNS * ROWS, bool), 0.45, turn)
    assert kept(graph, assignment).all()


@pytest.mark.parametrize("turn", [1, -1])
def test_a_strip_beyond_a_fold_is_left_out(turn: int):
    """Oracle: the last three rows, which show the neighbouring column's codes.

    The row between may go either way: its surroundings lie on both sides.
    """
    row = np.repeat(np.arange(ROWS), COLUMNS)
    graph, assignment = grid(row >= ROWS - 3, 0.8, turn)
    left = kept(graph, assignment)
    assert not left[row >= ROWS - 2].any()
    assert left[row < ROWS - 4].all()


def test_nothing_assigned():
    graph, assignment = grid(np.zeros(COLUMNS * ROWS, bool), 0.8)
    none = NodeAssignment(np.zeros(COLUMNS * ROWS, bool), assignment.node, 1, 0.0)
    assert not kept(graph, none).any()

"""Strips of nodes that wrong links joined to a grid, in a graph drawn by hand."""

import numpy as np
import pytest

from mitsuba_endo.decode.gap_code import gap_code
from mitsuba_endo.decode.grid.graph import GridGraph, graph_of
from mitsuba_endo.decode.grid.identify import SLIPS
from mitsuba_endo.decode.grid.identity import Identity
from mitsuba_endo.decode.grid.links import Links
from mitsuba_endo.decode.grid.nodes import Nodes
from mitsuba_endo.decode.grid.surroundings import without_misfits
from mitsuba_endo.decode.grid.vote import evidence

PATTERN = gap_code(20, 18)
COLUMNS, ROWS = 9, 8
FIRST = np.array([5, 6])
"""Column and row in the pattern of the first node."""


def grid(strayed: np.ndarray, sure: float, turn: int = 1) -> tuple[GridGraph, Identity]:
    """Return a grid of nodes of which some show the codes one column further."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    place = np.stack([x, y], -1)
    node = FIRST + place if turn == 1 else np.array(PATTERN.shape[::-1]) - 1 - FIRST - place
    shown = node + np.where(strayed[:, None], [1, 0], 0)
    code = np.full((len(place), 3), (1 - sure) / 2)
    code[np.arange(len(place)), 1 - PATTERN[shown[:, 1], shown[:, 0]]] = sure
    nodes = Nodes(10.0 * place, np.tile(np.eye(2) / 10, (len(place), 1, 1)), code)
    right, below = np.flatnonzero(x < COLUMNS - 1), np.flatnonzero(y < ROWS - 1)
    start, end = np.concatenate([right, below]), np.concatenate([right + 1, below + COLUMNS])
    axis = np.repeat([0, 1], [len(right), len(below)])
    links = Links(start, end, axis, np.full(len(start), 0.9))
    return graph_of(nodes, links), Identity(np.ones(len(place), bool), node, turn, 1.0)


def found(graph: GridGraph, identity: Identity) -> np.ndarray:
    return without_misfits(graph, identity, evidence(graph.nodes.code), PATTERN, SLIPS).placed


@pytest.mark.parametrize("turn", [1, -1])
def test_right_codes_stay(turn: int):
    """Oracle: nothing speaks against a node, even where one in three is hardly read."""
    graph, identity = grid(np.zeros(COLUMNS * ROWS, bool), 0.45, turn)
    assert found(graph, identity).all()


@pytest.mark.parametrize("turn", [1, -1])
def test_a_strip_beyond_a_fold_is_left_out(turn: int):
    """Oracle: the last three rows, which show the neighbouring column's codes.

    The row between may go either way: its surroundings lie on both sides.
    """
    row = np.repeat(np.arange(ROWS), COLUMNS)
    graph, identity = grid(row >= ROWS - 3, 0.8, turn)
    left = found(graph, identity)
    assert not left[row >= ROWS - 2].any()
    assert left[row < ROWS - 4].all()


def test_nothing_placed():
    graph, identity = grid(np.zeros(COLUMNS * ROWS, bool), 0.8)
    none = Identity(np.zeros(COLUMNS * ROWS, bool), identity.node, 1, 0.0)
    assert not found(graph, none).any()

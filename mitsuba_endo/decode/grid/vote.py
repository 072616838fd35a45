"""Which place in the pattern explains the codes of a set of nodes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from .heads import CODES

MISREAD = 0.1
"""Probability that a code is read wrong for reasons the network does not see."""
OUTSIDE = -1.5
"""Evidence of a node that would lie outside the pattern."""


@dataclass(frozen=True, order=True)
class Placement:
    """Column and row in the pattern = turn * place in the component + offset."""

    turn: int
    """1 upright, -1 upside down."""
    column: int
    row: int

    def shifted(self, columns: int, rows: int) -> "Placement":
        """Return the placement so many columns and rows further."""
        return Placement(self.turn, self.column + columns, self.row + rows)

    def of(self, place: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return column and row (..., 2) in the pattern."""
        return self.turn * place + np.array([self.column, self.row])


@dataclass(frozen=True)
class Vote:
    """What the codes of a set of nodes say."""

    best: Placement
    score: float
    """Sum over the nodes of log(probability of the pattern's code / one third)."""
    margin: float
    """Score less that of the next best placement."""


def evidence(code: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the log of the probabilities (N, 3) over chance, with room for misreadings."""
    return np.log(3 * (1 - MISREAD) * code + MISREAD)


def one_hot(pattern: NDArray[np.int8]) -> NDArray[np.float64]:
    """Return (3, rows, columns): where the pattern has each code, in the channels' order."""
    return np.stack([pattern == code for code in CODES]).astype(float)


def scores_at(
    placement: Placement,
    place: NDArray[np.intp],
    logs: NDArray[np.float64],
    pattern: NDArray[np.int8],
) -> NDArray[np.float64]:
    """Return the evidence (N,) of each node for a placement."""
    column, row = placement.of(place).T
    inside = (column >= 0) & (row >= 0) & (column < pattern.shape[1]) & (row < pattern.shape[0])
    code = pattern[np.where(inside, row, 0), np.where(inside, column, 0)]
    return np.where(inside, logs[np.arange(len(place)), CODES[0] - code], OUTSIDE)


def vote(
    place: NDArray[np.intp],
    logs: NDArray[np.float64],
    pattern: NDArray[np.int8],
    turns: tuple[int, ...] = (1, -1),
) -> Vote:
    """Score every placement with the codes of all nodes, by correlation.

    Args:
        place: (N, 2) column and row in the component.
        logs: (N, 3) evidence.
        pattern: (rows, columns) codes.
        turns: of the placements tried.
    """
    tables = {turn: _table(turn * place, logs, pattern) for turn in turns}
    found = []
    for turn, (table, first) in tables.items():
        row, column = np.unravel_index(int(np.argmax(table)), table.shape)
        placement = Placement(turn, int(column) + int(first[0]), int(row) + int(first[1]))
        found.append((float(table[row, column]), placement, turn, row, column))
    score, best, turn, row, column = max(found, key=lambda f: f[0])
    tables[turn][0][row, column] = -np.inf
    second = max(float(table.max()) for table, _ in tables.values())
    return Vote(best, score, score - second)


def _table(
    place: NDArray[np.intp], logs: NDArray[np.float64], pattern: NDArray[np.int8]
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the score of every offset, and the offset (column, row) of its first entry."""
    low = place.min(0)
    width, height = place.max(0) - low + 1
    scene = np.zeros((3, height, width))
    x, y = (place - low).T
    for k in range(3):
        # A node inside the pattern gives back the penalty that all begin with.
        np.add.at(scene[k], (y, x), logs[:, k] - OUTSIDE)
    table = fftconvolve(one_hot(pattern), scene[:, ::-1, ::-1], axes=(1, 2)).sum(0)
    return table + OUTSIDE * len(place), -low - np.array([width - 1, height - 1])

"""The code of the grid: which way the horizontal line steps at each node.

A 3 x 3 neighbourhood of codes occurs once in the pattern, also when it is seen upside down, so it
names its place. No mirrored neighbourhood occurs at all, so a mirrored pattern is told apart.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

WINDOW = 3
"""Nodes along a side of the neighbourhood that names its place: 3^9 = 19,683 codes, while 2 x 2
would have 81."""
LETTERS = {1: "R", 0: "S", -1: "L"}
"""Right part of the line higher, both level, left part higher."""
MAX_STEPS = 30
"""Nodes tried, per node of the grid, before the search gives up."""


@cache
def gap_code(rows: int, columns: int, seed: int = 0) -> NDArray[np.int8]:
    """Return codes (rows, columns) of -1, 0 and 1, read-only.

    A depth-first search with random choices and backtracking, row by row: a node whose three codes
    all repeat a neighbourhood sends the search back to the node before it. The same arguments give
    the same code.

    Raises:
        InputError: no code was found; about 48 x 48 nodes is the most.
    """
    rng = np.random.default_rng(seed)
    code = np.zeros((rows, columns), np.int8)
    choices: list[list[int]] = []
    marked: list[tuple[int, ...]] = []
    taken: set[int] = set()
    for _ in range(MAX_STEPS * rows * columns):
        index = len(marked)
        if index == rows * columns:
            code.flags.writeable = False
            return code
        if len(choices) == index:
            choices.append([int(c) for c in rng.permutation([-1, 0, 1])])
        added = _place_one(code, divmod(index, columns), choices[-1], taken)
        if added is not None:
            marked.append(added)
            continue
        choices.pop()
        if not marked:
            break
        taken.difference_update(marked.pop())
    raise InputError(
        f"no code of {rows} x {columns} nodes was found", "gap code", "take fewer lines"
    )


def _place_one(
    code: NDArray[np.int8], node: tuple[int, int], choices: list[int], taken: set[int]
) -> tuple[int, ...] | None:
    """Try the codes left for a node; return the neighbourhoods it takes, None if none fits."""
    row, column = node
    while choices:
        code[node] = choices.pop()
        if row < WINDOW - 1 or column < WINDOW - 1:
            return ()
        window = code[row - WINDOW + 1 : row + 1, column - WINDOW + 1 : column + 1]
        neighbourhoods = _views(tuple(window.ravel().tolist()))
        if neighbourhoods and not taken.intersection(neighbourhoods):
            taken.update(neighbourhoods)
            return neighbourhoods
    return None


@cache
def _views(window: tuple[int, ...]) -> tuple[int, ...]:
    """Return the numbers of a window as seen upright, upside down and in both mirrors.

    Turning the pattern upside down leaves the step of each node as it is and reverses their order;
    a mirror exchanges R and L. Empty if two of the four are alike: such a window is ambiguous.
    """
    upright = np.array(window).reshape(WINDOW, WINDOW)
    turned = upright[::-1, ::-1]
    views = (upright, turned, -upright[:, ::-1], -upright[::-1])
    numbers = tuple(int((v.ravel() + 1) @ 3 ** np.arange(WINDOW**2)) for v in views)
    # The two mirrors are each other upside down, so either pair may coincide.
    return numbers if len(set(numbers)) == len(numbers) else ()


def window_distance(code: NDArray[np.int8], size: int = 5) -> int:
    """Return the least number of codes in which two windows of the pattern differ.

    Compared are all pairs of different windows, and each window with every one upside down, itself
    included: the number of misread codes that can pass for another place, plus one.
    """
    windows = np.lib.stride_tricks.sliding_window_view(code, (size, size)).reshape(-1, size**2)
    upright = _one_hot(windows)
    turned = _one_hot(windows[:, ::-1])
    same = upright @ upright.T
    np.fill_diagonal(same, 0)
    return int(size**2 - max(same.max(), (upright @ turned.T).max()))


def _one_hot(windows: NDArray[np.int8]) -> NDArray[np.float32]:
    parts = [windows == letter for letter in LETTERS]
    return np.concatenate(parts, axis=1).astype(np.float32)


def letters(code: NDArray[np.int8]) -> list[str]:
    """Return one string of R, S and L per row."""
    return ["".join(LETTERS[int(c)] for c in row) for row in code]

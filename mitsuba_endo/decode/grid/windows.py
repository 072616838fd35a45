"""Placements that windows of nodes ask for: a component across a fold holds several."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from .vote import Placement, one_hot

SIZE = 6
MIN_NODES = 20
MIN_SCORE = 0.4
"""Mean evidence of a window's nodes; a right window has about 1, of at most log(2.8)."""
MIN_MARGIN = 2.5
"""Evidence over the next best placement of the window."""
KEPT = 12


def candidates(
    place: NDArray[np.intp], logs: NDArray[np.float64], pattern: NDArray[np.int8]
) -> list[Placement]:
    """Return the placements that most windows of 6 x 6 nodes ask for, the commonest first."""
    low = place.min(0) - SIZE // 2
    width, height = place.max(0) - low + SIZE // 2 + 1
    x, y = (place - low).T
    scene, count = np.zeros((3, height, width)), np.zeros((height, width))
    for k in range(3):
        np.add.at(scene[k], (y, x), logs[:, k])
    np.add.at(count, (y, x), 1)
    size = _windows(count[None]).sum(-1)
    full = size >= MIN_NODES
    if not full.any():
        return []
    corners = np.argwhere(full)[:, ::-1] + low
    wanted: Counter[Placement] = Counter()
    values, corner_of = _pattern_windows(pattern)
    score = _windows(scene)[full] @ values.T
    best = score.argmax(1)
    top = np.partition(score, -2, axis=1)[:, -2:]
    good = (top[:, 1] >= MIN_SCORE * size[full]) & (top[:, 1] - top[:, 0] >= MIN_MARGIN)
    for corner, index in zip(corners[good], best[good], strict=True):
        turn, column, row = corner_of[index]
        # Upside down, the window's first node is the last of the pattern's window.
        away = SIZE - 1 if turn < 0 else 0
        wanted[Placement(int(turn), int(column + away - turn * corner[0]),
                         int(row + away - turn * corner[1]))] += 1  # fmt: skip
    return [placement for placement, _ in wanted.most_common(KEPT)]


def _windows(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return all windows of (C, H, W) as (H', W', C SIZE^2)."""
    view = np.lib.stride_tricks.sliding_window_view(image, (SIZE, SIZE), axis=(1, 2))
    return view.transpose(1, 2, 0, 3, 4).reshape(*view.shape[1:3], -1)


def _pattern_windows(
    pattern: NDArray[np.int8],
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the pattern's windows (P, 3 SIZE^2), upright and turned, and (turn, column, row).

    Half a window beyond the pattern's border is blank, which neither supports nor contradicts.
    """
    margin = SIZE // 2
    padded = np.pad(one_hot(pattern), ((0, 0), (margin, margin), (margin, margin)))
    upright = _windows(padded)
    turned = upright.reshape(*upright.shape[:2], 3, SIZE, SIZE)[..., ::-1, ::-1]
    values = np.concatenate([upright.reshape(-1, 3 * SIZE**2), turned.reshape(-1, 3 * SIZE**2)])
    row, column = np.indices(upright.shape[:2]).reshape(2, -1) - margin
    corner = np.stack([np.ones_like(row), column, row], -1)
    return values, np.concatenate([corner, corner * [-1, 1, 1]])

"""Semi-global matching: a cost volume aggregated along eight directions.

H. Hirschmueller, Stereo Processing by Semiglobal Matching and Mutual Information, 2008: along a
path L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, min L(q) + P2) - min L(q), with q the place
before p.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Volume = NDArray[np.float32]
"""(h, w, K) one cost for each of K hypotheses in every cell."""


def aggregated(cost: Volume, neighbour: float, jump: float) -> Volume:
    """Return the mean over eight directions of the costs of paths that end in each cell.

    Args:
        cost: of each hypothesis; neighbouring hypotheses are neighbours in depth.
        neighbour: P1, of a step to the next hypothesis from one cell to the next.
        jump: P2, of any other step.
    """
    out = np.zeros_like(cost)
    for lines, sums, shift in _directions(cost, out):
        before = lines[0].copy()
        sums[0] += before
        for line, total in zip(lines[1:], sums[1:], strict=True):
            before = _step(line, _shifted(before, shift), neighbour, jump)
            total += before
    return out / np.float32(8)


def _directions(cost: Volume, out: Volume) -> Iterator[tuple[Volume, Volume, int]]:
    """Yield views of costs and sums, lines first, and a path's shift from line to line."""
    for direction in (1, -1):
        for shift in (-1, 0, 1):
            yield cost[::direction], out[::direction], shift
        yield cost.swapaxes(0, 1)[::direction], out.swapaxes(0, 1)[::direction], 0


def _shifted(line: Volume, shift: int) -> Volume:
    """Return a line's costs (n, K) moved along it; what comes from outside begins anew there."""
    if shift == 0:
        return line
    moved = np.roll(line, shift, 0)
    moved[0 if shift > 0 else -1] = 0
    return moved


def _step(cost: NDArray, before: NDArray, neighbour: float, jump: float) -> NDArray:
    least = before.min(-1, keepdims=True)
    best = np.minimum(before, least + np.float32(jump))
    best[:, 1:] = np.minimum(best[:, 1:], before[:, :-1] + np.float32(neighbour))
    best[:, :-1] = np.minimum(best[:, :-1], before[:, 1:] + np.float32(neighbour))
    return cost + best - least

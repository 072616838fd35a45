"""Which offset to the pattern explains the codes of a set of nodes.

Evidence is the log of a likelihood ratio, of the pattern's code over chance, summed over nodes.
"""

from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, next_fast_len, rfft2

from ..network import CODES
from .settings import MatcherSettings


@dataclass(frozen=True, order=True)
class PatternOffset:
    """Column and row in the pattern = turn * column and row in the component + offset."""

    turn: int
    """1 upright, -1 upside down."""
    column: int
    row: int

    def shifted(self, columns: int, rows: int) -> "PatternOffset":
        """Return the offset so many columns and rows further."""
        return PatternOffset(self.turn, self.column + columns, self.row + rows)

    def of(self, index: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return column and row (..., 2) in the pattern."""
        return self.turn * index + np.array([self.column, self.row])


@dataclass(frozen=True)
class OffsetVote:
    """What the codes of a set of nodes say."""

    best: PatternOffset
    evidence: float
    margin: float
    """Evidence less that of the next best offset."""


@dataclass(frozen=True, eq=False)
class CodeMatcher:
    """The codes that were read at nodes, against those of the pattern."""

    read: NDArray[np.float64]
    """(N, 3) evidence of R, S and L at each node."""
    code: NDArray[np.int8]
    """(rows, columns) of the pattern."""
    settings: MatcherSettings

    @classmethod
    def of(
        cls, probability: NDArray[np.float64], code: NDArray[np.int8], settings: MatcherSettings
    ) -> "CodeMatcher":
        """Return the matcher for probabilities (N, 3), with room for misreadings."""
        evidence = np.log(3 * (1 - settings.misread) * probability + settings.misread)
        return cls(evidence, code, settings)

    def among(self, members: NDArray[np.intp]) -> "CodeMatcher":
        """Return the matcher for some of the nodes."""
        return replace(self, read=self.read[members])

    def inside(self, node: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Tell which columns and rows (N, 2) lie in the pattern."""
        return np.asarray(((node >= 0) & (node < self.code.shape[::-1])).all(1))

    def at(self, node: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the evidence (N,) that the nodes are those of columns and rows (N, 2)."""
        inside = self.inside(node)
        column, row = np.where(inside[:, None], node, 0).T
        read = self.read[np.arange(len(node)), CODES[0] - self.code[row, column]]
        return np.where(inside, read, self.settings.outside)

    def vote(self, index: NDArray[np.intp]) -> OffsetVote:
        """Score every offset with the codes of all nodes, by correlation.

        Args:
            index: (N, 2) column and row in the component.
        """
        tables = {turn: self._table(turn * index) for turn in (1, -1)}
        best_of_turn = []
        for turn, (table, first) in tables.items():
            row, column = np.unravel_index(int(np.argmax(table)), table.shape)
            offset = PatternOffset(turn, int(column) + int(first[0]), int(row) + int(first[1]))
            best_of_turn.append((float(table[row, column]), offset, turn, row, column))
        evidence, best, turn, row, column = max(best_of_turn, key=lambda entry: entry[0])
        tables[turn][0][row, column] = -np.inf
        second = max(float(table.max()) for table, _ in tables.values())
        return OffsetVote(best, evidence, evidence - second)

    def _table(self, index: NDArray[np.intp]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return the evidence of every offset, and the offset (column, row) of its first entry."""
        outside = self.settings.outside
        # A node inside the pattern gives back the penalty that all begin with.
        image = _image(index, self.read - outside, index.min(0), index.max(0))
        table = _convolved(self._one_hot, image[:, ::-1, ::-1])
        height, width = image.shape[1:]
        return table + outside * len(index), -index.min(0) - np.array([width - 1, height - 1])

    def window_offsets(self, index: NDArray[np.intp]) -> list[PatternOffset]:
        """Return the offsets that most windows of nodes ask for, the commonest first.

        A component across a fold holds several.
        """
        settings = self.settings
        margin = settings.window // 2
        low, high = index.min(0) - margin, index.max(0) + margin
        size = self._windows(_image(index, np.ones((len(index), 1)), low, high)).sum(-1)
        full = size >= settings.window_nodes
        if not full.any():
            return []
        corner = np.argwhere(full)[:, ::-1] + low
        values, corner_of = self._pattern_windows()
        evidence = self._windows(_image(index, self.read, low, high))[full] @ values.T
        second, best = np.partition(evidence, -2, axis=1)[:, -2:].T
        good = (best >= settings.window_evidence * size[full]) & (
            best - second >= settings.window_margin
        )
        wanted: Counter[PatternOffset] = Counter()
        for image_corner, match in zip(corner[good], evidence.argmax(1)[good], strict=True):
            turn, *pattern_corner = corner_of[match].tolist()
            # Upside down, the window's first node is the last of the pattern's window.
            away = settings.window - 1 if turn < 0 else 0
            column, row = (
                int(p + away - turn * s) for p, s in zip(pattern_corner, image_corner, strict=True)
            )
            wanted[PatternOffset(turn, column, row)] += 1
        return [offset for offset, _ in wanted.most_common(settings.window_offsets)]

    @cached_property
    def _one_hot(self) -> NDArray[np.float64]:
        """(3, rows, columns): where the pattern has each code, in the channels' order."""
        return np.stack([self.code == code for code in CODES]).astype(float)

    def _windows(self, image: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all windows of (C, H, W) as (H', W', C nodes)."""
        size = (self.settings.window, self.settings.window)
        view = np.lib.stride_tricks.sliding_window_view(image, size, axis=(1, 2))
        return view.transpose(1, 2, 0, 3, 4).reshape(*view.shape[1:3], -1)

    def _pattern_windows(self) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return the pattern's windows (P, 3 nodes), upright and turned, and (turn, column, row).

        Half a window beyond the pattern's border is blank, which neither supports nor contradicts.
        """
        size = self.settings.window
        margin = size // 2
        padded = np.pad(self._one_hot, ((0, 0), (margin, margin), (margin, margin)))
        upright = self._windows(padded)
        turned = upright.reshape(*upright.shape[:2], 3, size, size)[..., ::-1, ::-1]
        values = np.concatenate([upright.reshape(-1, 3 * size**2), turned.reshape(-1, 3 * size**2)])
        row, column = np.indices(upright.shape[:2]).reshape(2, -1) - margin
        corner = np.stack([np.ones_like(row), column, row], -1)
        return values, np.concatenate([corner, corner * [-1, 1, 1]])


def _image(
    index: NDArray[np.intp],
    values: NDArray[np.float64],
    low: NDArray[np.intp],
    high: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return values (N, K) of nodes at columns and rows (N, 2) as an image (K, H, W)."""
    width, height = high - low + 1
    image = np.zeros((values.shape[1], height, width))
    x, y = (index - low).T
    for k, layer in enumerate(image):
        np.add.at(layer, (y, x), values[:, k])
    return image


def potts_labels(
    cost: NDArray[np.float64],
    links: tuple[NDArray[np.intp], NDArray[np.intp]],
    price: NDArray[np.float64],
    *,
    rounds: int,
    damping: float,
) -> NDArray[np.intp]:
    """Return labels (N,) of a low sum of their costs and of the prices of links between labels.

    Min-sum loopy belief propagation for the Potts model (P. Felzenszwalb and D. Huttenlocher,
    "Efficient belief propagation for early vision", 2006).

    Args:
        cost: (N, K) of each label at each node.
        links: (L,) nodes at their starts and ends.
        price: (L,) of different labels at its ends.
        rounds: of messages.
        damping: share of the old message that is kept.
    """
    source, target = np.concatenate(links), np.concatenate(links[::-1])
    reverse = np.roll(np.arange(len(source)), len(price))
    both = np.concatenate([price, price])[:, None]
    message = np.zeros((len(source), cost.shape[1]))

    def beliefs() -> NDArray[np.float64]:
        sums = [np.bincount(target, column, minlength=len(cost)) for column in message.T]
        return cost + np.stack(sums, -1)

    for _ in range(rounds):
        outgoing = beliefs()[source] - message[reverse]
        outgoing -= outgoing.min(1, keepdims=True)
        message = damping * message + (1 - damping) * np.minimum(outgoing, both)
    return beliefs().argmin(1)


def _convolved(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum over layers (first axis) of the full convolutions of their images.

    One inverse transform serves all layers.
    """
    (_, m, n), (_, p, q) = a.shape, b.shape
    size = [next_fast_len(m + p - 1, real=True), next_fast_len(n + q - 1, real=True)]
    product = np.asarray(rfft2(a, size)) * np.asarray(rfft2(b, size))
    return np.asarray(irfft2(product.sum(0), size))[: m + p - 1, : n + q - 1]

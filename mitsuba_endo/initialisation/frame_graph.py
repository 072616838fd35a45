"""The graph of frames and of the placements found between them."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from .pairs import refine_pair, register_pair
from .range_image import RangePyramid
from .registration_quality import FLAT, PairRegistration, judge
from .similarity import Similarities

MAX_ATTEMPTS = 4
"""Searches spent on one frame beyond the one against the previous frame."""
CHECKED_SHARE = 0.4
"""A loop is checked where the chain predicts that this share of a frame is in common view."""
SAME_TURN, SAME_SHIFT = 0.07, 0.07
"""A placement refined from the chain's prediction stays within this (radians, relative to the
typical range) if the chain is right."""
LOOP = "contradicts the other frames around a loop"


@dataclass(frozen=True, eq=False)
class ChainedFrame:
    """A frame reached from a root frame along trusted placements."""

    root_from_frame: Similarities
    """One transform, in the common unit."""
    last: PairRegistration
    """The placement used last on the way."""
    parent: int
    """The frame before it on the way."""


class FrameGraph:
    """Frames as nodes and trusted placements as edges; grows by :meth:`connect`."""

    def __init__(self, frames: list[RangePyramid], rng: np.random.Generator) -> None:
        self.frames = frames
        self._rng = rng
        self._pairs: dict[tuple[int, int], PairRegistration] = {}
        """Every placement tried, by (target, source) with target < source."""
        self._faults: dict[tuple[int, int], str] = {}
        """Why a placement is not trusted, empty if it is."""

    def connect(self) -> None:
        """Register neighbours, then try frames that fit nowhere yet against others."""
        for k in range(1, len(self.frames)):
            if self.frames[k - 1].usable and self.frames[k].usable:
                self._try(k - 1, k)
        group = self._groups()
        for j, k in self._candidates():
            if group[j] != group[k] and self._worth_trying(j, k, group) and self._try(j, k):
                group = self._groups()

    def check_loops(self) -> None:
        """Compare the chain with placements that close loops; drop edges that contradict.

        The chain predicts the placement of frames that no edge joins. Where both should see the
        same surface, a refinement from there must fit and stay near; if it does not, the edge of
        the path with the nearest runner-up is dropped unless another loop supports it.
        """
        supported: set[tuple[int, int]] = set()
        suspects: list[tuple[int, int]] = []
        for j, k in self._loops():
            path = self._path(j, k)
            if not path:
                continue
            verdict = self._closes(j, k)
            if verdict is True:
                supported.update(path)
            elif verdict is False:
                suspects.append(min(path, key=lambda e: self._pairs[e].runner_up))
        for edge in set(suspects) - supported:
            self._faults[edge] = LOOP

    def group_of(self, k: int) -> list[int]:
        """Return the frames joined to ``k``, itself included, in order."""
        return sorted(self._walk(k))

    def largest_group(self) -> list[int]:
        """Return the largest group of joined usable frames; the one of the first frame in a tie."""
        usable = [k for k, frame in enumerate(self.frames) if frame.usable]
        return self.group_of(max(usable, key=lambda k: len(self.group_of(k))))

    def chained_frames(self, root: int) -> dict[int, ChainedFrame]:
        """Return where the frames joined to ``root`` are, itself included."""
        return self._walk(root)

    def attempts(self, k: int, group: list[int]) -> dict[int, PairRegistration]:
        """Return the placements of frame ``k`` that were tried in the frames of ``group``."""
        return {
            j: self._placement(j, k)
            for j in group
            if j != k and (min(j, k), max(j, k)) in self._pairs
        }

    def faults(self, k: int, group: list[int]) -> dict[int, str]:
        """Return why those were not trusted."""
        return {j: self._faults[min(j, k), max(j, k)] for j in self.attempts(k, group)}

    def _try(self, j: int, k: int) -> bool:
        """Search for the placement of frame ``k`` in frame ``j``; tell whether it is trusted."""
        pair = register_pair(self.frames[j], self.frames[k], self._rng)
        self._pairs[j, k] = pair
        self._faults[j, k] = pair.fault
        return not pair.fault

    def _candidates(self) -> list[tuple[int, int]]:
        """Return pairs of usable frames, near ones first."""
        usable = [k for k, frame in enumerate(self.frames) if frame.usable]
        return sorted(combinations(usable, 2), key=lambda p: p[1] - p[0])

    def _groups(self) -> list[list[int]]:
        """Return for each frame the frames joined to it."""
        groups: dict[int, list[int]] = {}
        for k in range(len(self.frames)):
            if k not in groups:
                group = self.group_of(k)
                groups.update(dict.fromkeys(group, group))
        return [groups[k] for k in range(len(self.frames))]

    def _worth_trying(self, j: int, k: int, group: list[list[int]]) -> bool:
        """Tell whether two frames of different groups are untried and have attempts left."""
        if (j, k) in self._pairs:
            return False
        # The attempts of the smaller group's frame count: the other may serve many.
        stray = min((j, k), key=lambda f: len(group[f]))
        return sum(b - a > 1 for a, b in self._pairs if stray in (a, b)) < MAX_ATTEMPTS

    def _loops(self) -> Iterator[tuple[int, int]]:
        """Yield the pairs of frames to check: two apart, and each with the first."""
        n = len(self.frames)
        yield from ((k - 2, k) for k in range(2, n))
        yield from ((0, k) for k in range(3, n))

    def _closes(self, j: int, k: int) -> bool | None:
        """Tell whether the chain's placement of ``k`` in ``j`` fits; None if it cannot be told."""
        guess = self._walk(j)[k].root_from_frame
        target, source = self.frames[j], self.frames[k]
        if judge(guess, target, source, self._rng).in_view < CHECKED_SHARE:
            return None
        pair = refine_pair(guess, target, source, self._rng)
        if pair.fit.fault:
            return None if pair.fit.fault == FLAT else False
        refined = pair.target_from_source
        shift = np.linalg.norm(refined.t - guess.t)
        return bool(refined.angle_to(guess)[0] < SAME_TURN and shift < SAME_SHIFT)

    def _placement(self, j: int, k: int) -> PairRegistration:
        """Return the placement of frame ``k`` in frame ``j``."""
        return self._pairs[j, k] if j < k else self._pairs[k, j].inverse()

    def _neighbours(self, j: int) -> list[int]:
        """Return the frames joined to ``j`` by trusted placements, the firmest first."""
        edges = [e for e, fault in self._faults.items() if j in e and not fault]
        edges.sort(key=lambda e: -self._pairs[e].runner_up)
        return [a if b == j else b for a, b in edges]

    def _walk(self, root: int) -> dict[int, ChainedFrame]:
        """Visit the frames joined to ``root``, breadth first, and chain their placements."""
        reached = {root: ChainedFrame(Similarities.identity(), PairRegistration(), root)}
        queue = [root]
        for j in queue:
            for k in self._neighbours(j):
                if k not in reached:
                    pair = self._placement(j, k)
                    chained = reached[j].root_from_frame @ pair.target_from_source
                    reached[k] = ChainedFrame(chained, pair, j)
                    queue.append(k)
        return reached

    def _path(self, j: int, k: int) -> list[tuple[int, int]]:
        """Return the edges of the path between two frames; empty if it is one edge or none."""
        reached = self._walk(j)
        path = []
        while k in reached and k != j:
            parent = reached[k].parent
            path.append((min(k, parent), max(k, parent)))
            k = parent
        return path if len(path) > 1 else []

"""Normal equations of all frames' poses and the focal length, the surface elements eliminated.

Every element has one unknown, its way along its normal, and no two elements share an observation.
So the Schur complement over all of them is a sum over elements of rank one each: with c the
derivatives of an element's observations by its own unknown, w their weights and J those by the
poses, it subtracts g g^T W with W = sum w c^2 and g = sum w c J / W. It is summed over chunks of
elements that lie together, which few frames see.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .observations import Seen

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

FRAME = 12
"""Unknowns of a frame: steps of the projector and of the camera, see :meth:`Poses.moved`."""
CHUNK = 400
"""Elements eliminated at once."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Of a frame's observations."""

    across: Floats
    """(N,)."""
    along: Floats
    """(N,)."""


@dataclass(frozen=True, eq=False)
class Response:
    """How some elements follow the other unknowns: their way is ``mean - g^T x``."""

    first: int
    """Number of the first element."""
    columns: Index
    """(C,) of the unknowns, those that the elements depend on."""
    g: NDArray[np.float32]
    """(C, elements)."""

    def among(self, element: Index) -> slice:
        """Return where its elements lie among ascending numbers of elements."""
        first, end = np.searchsorted(element, [self.first, self.first + self.g.shape[1]])
        return slice(int(first), int(end))


@dataclass(frozen=True, eq=False)
class Equations:
    """A x = b for a step x (12 K + 1,) of K frames and the log of the focal length."""

    A: Floats
    b: Floats
    mean: Floats
    """(M,) way of each element without a step."""
    information: Floats
    """(M,) of each element on its way, poses given; 0 where fewer than two frames saw it."""
    responses: list[Response]

    def element_steps(self, step: Floats) -> Floats:
        """Return how far (M,) the elements go with a step of all other unknowns."""
        steps = self.mean.copy()
        for part in self.responses:
            steps[part.first : part.first + part.g.shape[1]] -= step[part.columns] @ part.g
        return steps


def equations(
    all_observations: Sequence[Seen], weights: Sequence[Weights], count: int
) -> Equations:
    """Sum what frames saw and eliminate the elements.

    Args:
        all_observations: by each of the K frames.
        weights: of their observations.
        count: of elements, M.
    """
    size = FRAME * len(all_observations) + 1
    A, b = np.zeros((size, size)), np.zeros(size)
    information, mean = _elements(all_observations, weights, count)
    for k, (s, w) in enumerate(zip(all_observations, weights, strict=True)):
        shared = information[s.element] > 0
        on_surface = np.where(shared, w.along, 0.0)
        left = s.along - s.by_element * mean[s.element]
        at = columns_of(k, size)
        rows, rows_across = s.by_unknowns, s.across_by_unknowns
        A[np.ix_(at, at)] += (rows * on_surface) @ rows.T
        A[np.ix_(at, at)] += (rows_across * w.across) @ rows_across.T
        b[at] += rows @ (on_surface * left) + rows_across @ (w.across * s.across)
    responses = list(_responses(all_observations, weights, information, size))
    for part in responses:
        inside = information[part.first : part.first + part.g.shape[1]]
        A[np.ix_(part.columns, part.columns)] -= (part.g * inside) @ part.g.T
    return Equations(A, b, mean, information, responses)


def columns_of(frame: int, size: int) -> Index:
    """Return the columns (13,) of a frame's unknowns and of the focal length."""
    return np.append(np.arange(FRAME * frame, FRAME * (frame + 1)), size - 1)


def _elements(
    all_observations: Sequence[Seen], weights: Sequence[Weights], count: int
) -> tuple[Floats, Floats]:
    """Return the information on each element (M,), and its way with the poses as they are (M,)."""
    information, pull, frames = np.zeros(count), np.zeros(count), np.zeros(count)
    for s, w in zip(all_observations, weights, strict=True):
        by = w.along * s.by_element
        information += np.bincount(s.element, by * s.by_element, count)
        pull += np.bincount(s.element, by * s.along, count)
        frames += np.bincount(s.element, minlength=count)
    information[frames < 2] = 0.0
    informed = information > 0
    return information, np.where(informed, pull / np.where(informed, information, 1.0), 0.0)


def _responses(
    all_observations: Sequence[Seen], weights: Sequence[Weights], information: Floats, size: int
) -> Iterator[Response]:
    edges = np.append(np.arange(0, len(information), CHUNK), len(information))
    cuts = [np.searchsorted(s.element, edges) for s in all_observations]
    for chunk, (first, end) in enumerate(pairwise(edges)):
        frames = [k for k, cut in enumerate(cuts) if cut[chunk + 1] > cut[chunk]]
        g = np.zeros((FRAME * len(frames) + 1, end - first))
        for i, k in enumerate(frames):
            part = slice(cuts[k][chunk], cuts[k][chunk + 1])
            s, here = all_observations[k], all_observations[k].element[part] - first
            by = s.by_unknowns[:, part] * (weights[k].along * s.by_element)[part]
            g[FRAME * i : FRAME * (i + 1), here] = by[:FRAME]
            g[-1, here] += by[FRAME]
        informed = information[first:end] > 0
        g *= np.where(informed, 1 / np.where(informed, information[first:end], 1.0), 0.0)
        columns = np.concatenate([[], *(columns_of(k, size)[:FRAME] for k in frames), [size - 1]])
        yield Response(int(first), columns.astype(np.int64), g.astype(np.float32))

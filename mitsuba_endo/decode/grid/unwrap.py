"""Dense places in the pattern: each cell gets that of its node, or of the cells around it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .cells import Cells, find_cells
from .heads import Heads
from .identity import Identity
from .nodes import Nodes, larger, phase_slope
from .planes import drawn_to_planes

MIN_CONFIDENCE = 0.5
MAX_EDGE = 0.8
ROUNDS = 2
"""Cells without a node of their own are reached from placed ones in so many steps."""
AGREEMENT = 0.8
"""Of the border to placed cells that must ask for the same place."""
MAX_SLOPE = 0.25
"""Periods per pixel; where the pattern is more crowded, pixels mix several lines."""
DOUBT = 4
"""Pixels around a contradiction between neighbouring cells that are left out."""
UNKNOWN = np.iinfo(np.int32).min // 2


def unwrap(heads: Heads, nodes: Nodes, identity: Identity) -> NDArray[np.float32]:
    """Return column and row (H, W, 2) in the pattern, continuous; NaN where not known.

    Args:
        heads: of the image.
        nodes: of the image.
        identity: which of them are which.
    """
    usable = (heads.confidence > MIN_CONFIDENCE) & (heads.edge < MAX_EDGE)
    usable &= larger(larger(phase_slope(heads.phase))) < MAX_SLOPE
    cells = find_cells(heads.phase, usable)
    # Upside down, the phase runs against the pattern: count nodes along the phase.
    place, blocked = _of_nodes(cells, nodes, identity)
    for _ in range(ROUNDS):
        place = _spread(cells, place, blocked)
    known = (place[:, 0] != UNKNOWN)[cells.number] & usable
    known &= ~_contradicted(cells, place)
    lattice = identity.turn * (place[cells.number] + heads.phase)
    lattice = np.where(known[..., None], lattice, np.nan).astype(np.float32)
    return drawn_to_planes(lattice, heads.confidence)


def _of_nodes(
    cells: Cells, nodes: Nodes, identity: Identity
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the place (C, 2) of each cell with placed nodes, and cells (C,) to leave alone.

    Left alone are cells of nodes that were refused, and of nodes with different places.
    """
    cell = cells.number[nodes.pixel]
    place = np.full((cells.count, 2), UNKNOWN)
    blocked = np.zeros(cells.count, bool)
    wanted = identity.turn * identity.node
    at, placed = cell[identity.placed], wanted[identity.placed]
    place[at] = placed
    blocked[cell[~identity.placed]] = True
    # Of several nodes in a cell the last one was written: the others must agree with it.
    blocked[at[(place[at] != placed).any(1)]] = True
    blocked[0] = True
    place[blocked] = UNKNOWN
    return place, blocked


def _spread(cells: Cells, place: NDArray[np.intp], blocked: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Place cells next to placed ones, if most of the border between them asks for one place."""
    flat = cells.number.ravel()
    first, second = flat[cells.first], flat[cells.second]
    source = np.concatenate([first, second])
    target = np.concatenate([second, first])
    step = np.concatenate([cells.step, -cells.step])
    open_ = (place[source, 0] != UNKNOWN) & (place[target, 0] == UNKNOWN) & ~blocked[target]
    target, wanted = target[open_], (place[source] + step)[open_]
    if not len(target):
        return place
    rows, votes = np.unique(np.column_stack([target, wanted]), axis=0, return_counts=True)
    total = np.bincount(rows[:, 0], votes, minlength=cells.count)
    won = votes >= AGREEMENT * total[rows[:, 0]]
    place = place.copy()
    place[rows[won, 0]] = rows[won, 1:]
    return place


def _contradicted(cells: Cells, place: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return the pixels (H, W) beside borders whose cells' places do not fit the phase."""
    flat = cells.number.ravel()
    first, second = place[flat[cells.first]], place[flat[cells.second]]
    both = (first[:, 0] != UNKNOWN) & (second[:, 0] != UNKNOWN)
    wrong = both & (second - first != cells.step).any(1)
    mask = np.zeros(cells.number.shape, np.uint8)
    mask.ravel()[cells.first[wrong]] = 1
    mask.ravel()[cells.second[wrong]] = 1
    return cv2.dilate(mask, np.ones((2 * DOUBT + 1, 2 * DOUBT + 1), np.uint8)).astype(bool)

"""Small components beside placed nodes: their surroundings leave few placements to choose from."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .nodes import Nodes
from .vote import Placement, Vote, scores_at

NEAR = 3.0
"""Periods to the placed node that predicts the place of a node."""
MIN_SCORE = 0.2
"""Mean evidence of the component's nodes."""
MIN_EVIDENCE = 3.0
"""Of all nodes together, and over the next best placement."""


def vote_beside(
    members: NDArray[np.intp],
    placed: NDArray[np.intp],
    known: NDArray[np.intp],
    nodes: Nodes,
    place: NDArray[np.intp],
    logs: NDArray[np.float64],
    pattern: NDArray[np.int8],
    turn: int,
    slips: list[tuple[int, int]],
) -> Vote | None:
    """Return the best placement of a component among those its surroundings allow.

    A surface that runs on gives the place of a node from that of a node nearby; a fold between
    them shifts it by a few columns.

    Args:
        members: (M,) nodes of the component.
        placed: (P,) nodes that are placed already.
        known: (P, 2) their columns and rows in the pattern.
        nodes: all of the image.
        place: (N, 2) column and row in the component.
        logs: (N, 3) evidence.
        pattern: (rows, columns) codes.
        turn: of the placed nodes.
        slips: columns and rows by which a prediction may be off.
    """
    _, near = cKDTree(nodes.at[placed]).query(nodes.at[members])
    away = nodes.at[members] - nodes.at[placed[near]]
    moved = np.einsum("nij,nj->ni", nodes.slope[placed[near]], away)
    close = np.abs(moved).max(1) < NEAR
    predicted = known[near] + turn * np.rint(moved).astype(np.intp)
    offsets = np.unique((predicted - turn * place[members])[close], axis=0)
    tried = {Placement(turn, int(x), int(y)).shifted(*slip) for x, y in offsets for slip in slips}
    found = sorted(
        (float(scores_at(one, place[members], logs[members], pattern).sum()), one) for one in tried
    )
    if len(found) < 2:
        return None
    (second, _), (score, best) = found[-2:]
    enough = score >= max(MIN_EVIDENCE, MIN_SCORE * len(members))
    return Vote(best, score, score - second) if enough and score - second >= MIN_EVIDENCE else None

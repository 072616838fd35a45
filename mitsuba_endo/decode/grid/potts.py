"""Cutting a graph into parts of one label each, by belief propagation."""

import numpy as np
from numpy.typing import NDArray

ROUNDS = 40
DAMPING = 0.5


def cut(
    cost: NDArray[np.float64],
    start: NDArray[np.intp],
    end: NDArray[np.intp],
    weight: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Return labels (N,) of a low sum of their costs and of the weights of links between labels.

    Min-sum loopy belief propagation for the Potts model (P. Felzenszwalb and D. Huttenlocher,
    "Efficient belief propagation for early vision", 2006).

    Args:
        cost: (N, K) of each label at each node.
        start: (L,) node of a link.
        end: (L,) node.
        weight: (L,) price of different labels at its ends.
    """
    source, target = np.concatenate([start, end]), np.concatenate([end, start])
    reverse = np.roll(np.arange(2 * len(start)), len(start))
    price = np.concatenate([weight, weight])[:, None]
    message = np.zeros((len(source), cost.shape[1]))
    for _ in range(ROUNDS):
        belief = _beliefs(cost, target, message)
        outgoing = belief[source] - message[reverse]
        outgoing -= outgoing.min(1, keepdims=True)
        message = DAMPING * message + (1 - DAMPING) * np.minimum(outgoing, price)
    return _beliefs(cost, target, message).argmin(1)


def _beliefs(
    cost: NDArray[np.float64], target: NDArray[np.intp], message: NDArray[np.float64]
) -> NDArray[np.float64]:
    incoming = [
        np.bincount(target, message[:, k], minlength=len(cost)) for k in range(cost.shape[1])
    ]
    return cost + np.stack(incoming, -1)

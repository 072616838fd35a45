"""The training of the graph network, on what the pixel network says of the training views."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor  # pyright: ignore[reportMissingImports]
from torch.nn.functional import (  # pyright: ignore[reportMissingImports]
    binary_cross_entropy_with_logits,
)

from ..decode.grid.network import Network
from .cache import ViewCache
from .compose import compose, random_effects, random_look
from .examples import PATTERNS
from .graph_model import GraphNet
from .graphs import LabelledGraph, labelled_graph
from .patterns import grid_texture
from .validation import FOLDED, clean_image, heavy_image

SHARE_FOLDED = 0.5
"""Of the graphs, beyond the share that folded views have anyway."""
SHARE_RANDOM, SHARE_HEAVY = 0.4, 0.45
"""Of the graphs with random and with heavy corruption; the others are clean."""
SCALED_BY = 50
"""Graphs that give the features' scale."""


@dataclass(frozen=True)
class GraphPlan:
    """How to train."""

    graphs: int = 700
    epochs: int = 5
    batch: int = 8
    """Graphs."""
    rate: float = 6e-3
    """Highest learning rate; a cosine takes it to zero."""
    decay: float = 1e-4
    """Weight decay."""
    seed: int = 0


def graphs_of(
    views: ViewCache, network: Network, plan: GraphPlan, tick: Callable[[int], None]
) -> list[LabelledGraph]:
    """Return graphs of composed images of whole views.

    Args:
        views: for training.
        network: the trained pixel network.
        plan: number and seed.
        tick: called with the number made so far.
    """
    folded = [index for index, kind in enumerate(views.kinds) if kind in FOLDED]
    graphs = []
    for number in range(plan.graphs):
        rng = np.random.default_rng((plan.seed, 31, number))
        among = folded if folded and rng.random() < SHARE_FOLDED else range(len(views))
        view, kind = views.view(int(rng.choice(among))), rng.random()
        if kind < SHARE_RANDOM:
            look, effects = random_look(rng), random_effects(rng)
        else:
            heavy = kind < SHARE_RANDOM + SHARE_HEAVY
            look, effects = heavy_image(rng) if heavy else clean_image()
        grid = grid_texture(int(rng.integers(PATTERNS)))
        grid = grid.turned() if rng.random() < 0.5 else grid
        image, truth = compose(view, grid, look, effects, rng)
        graphs.append(labelled_graph(network.heads(image), truth))
        tick(number + 1)
    return graphs


def train_graph_net(graphs: Sequence[LabelledGraph], plan: GraphPlan) -> GraphNet:
    """Return the network trained to tell real nodes and links (cross-entropy, AdamW)."""
    torch.manual_seed(plan.seed)
    net = GraphNet()
    some = joined(graphs[:SCALED_BY])
    net.scale_to(some.node, some.link)
    optimizer = torch.optim.AdamW(net.parameters(), lr=plan.rate, weight_decay=plan.decay)
    steps = plan.epochs * -(-len(graphs) // plan.batch)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, plan.rate, steps, pct_start=0.1)
    for batch in _batches(graphs, plan):
        node, link = net(batch.node, batch.link, batch.start, batch.end)
        loss = _cross_entropy(link, batch.link_real) + _cross_entropy(node, batch.node_real)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    return net.eval()


@dataclass(frozen=True, eq=False)
class _Batch:
    """Several graphs as one that is not connected."""

    node: Tensor
    link: Tensor
    start: Tensor
    end: Tensor
    node_real: Tensor
    link_real: Tensor


def _batches(graphs: Sequence[LabelledGraph], plan: GraphPlan) -> Iterator[_Batch]:
    rng = np.random.default_rng((plan.seed, 32))
    for _ in range(plan.epochs):
        order = rng.permutation(len(graphs))
        for first in range(0, len(order), plan.batch):
            yield joined([graphs[k] for k in order[first : first + plan.batch]])


def joined(graphs: Sequence[LabelledGraph]) -> _Batch:
    """Return several graphs as one."""
    before = np.cumsum([0, *(len(g.node) for g in graphs[:-1])])
    start, end = (
        np.concatenate([getattr(g.links, name) + n for g, n in zip(graphs, before, strict=True)])
        for name in ("start", "end")
    )
    node, link, node_real, link_real = (
        np.concatenate([getattr(g, name) for g in graphs])
        for name in ("node", "link", "node_real", "link_real")
    )
    return _Batch(
        node=torch.from_numpy(node),
        link=torch.from_numpy(link),
        start=torch.from_numpy(start),
        end=torch.from_numpy(end),
        node_real=torch.from_numpy(node_real),
        link_real=torch.from_numpy(link_real),
    )


def _cross_entropy(logit: Tensor, real: Tensor) -> Tensor:
    return binary_cross_entropy_with_logits(logit, real.float())

"""A network that judges a graph's nodes and links together with those around.

Each round, every link tells both its ends what it and the other end are, every node adds that up,
and every link hears its ends again (message passing; W. Hamilton et al., "Inductive representation
learning on large graphs", 2017).
"""

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor, nn  # pyright: ignore[reportMissingImports]
from torch.nn.functional import relu  # pyright: ignore[reportMissingImports]

from .graph_features import LINK_FEATURES, NODE_FEATURES

WIDTH = 16
ROUNDS = 2
LEAST_SCALE = 1e-2
"""Of features that hardly vary."""


class Round(nn.Module):
    """What nodes and links learn from those beside them."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.message = nn.Linear(2 * width, width)
        self.node = nn.Linear(2 * width, width)
        self.link = nn.Linear(3 * width, width)

    def forward(self, h: Tensor, e: Tensor, start: Tensor, end: Tensor) -> tuple[Tensor, Tensor]:
        source, target = torch.cat([start, end]), torch.cat([end, start])
        message = relu(self.message(torch.cat([h[source], torch.cat([e, e])], 1)))
        heard = torch.zeros_like(h).index_add(0, target, message)
        h = h + relu(self.node(torch.cat([h, heard], 1)))
        e = e + relu(self.link(torch.cat([e, *ends(h, start, end)], 1)))
        return h, e


class GraphNet(nn.Module):
    """Features of nodes (N, F) and links (L, G) to logits (N,) and (L,)."""

    node_mean: Tensor
    node_scale: Tensor
    link_mean: Tensor
    link_scale: Tensor

    def __init__(self, width: int = WIDTH, rounds: int = ROUNDS) -> None:
        super().__init__()
        # Features differ in scale by a hundred; unscaled, hardly anything was learnt.
        for name, count in (("node", len(NODE_FEATURES)), ("link", len(LINK_FEATURES))):
            self.register_buffer(f"{name}_mean", torch.zeros(count))
            self.register_buffer(f"{name}_scale", torch.ones(count))
        self.node_in = nn.Linear(len(NODE_FEATURES), width)
        self.link_in = nn.Linear(len(LINK_FEATURES), width)
        self.rounds = nn.ModuleList(Round(width) for _ in range(rounds))
        self.node_out = nn.Linear(width, 1)
        self.link_out = nn.Linear(3 * width, 1)

    def scale_to(self, node: Tensor, link: Tensor) -> None:
        """Take mean and standard deviation of features (N, F) and (L, G) of training graphs."""
        for name, values in (("node", node), ("link", link)):
            getattr(self, f"{name}_mean").copy_(values.mean(0))
            getattr(self, f"{name}_scale").copy_(values.std(0) + LEAST_SCALE)

    def forward(
        self, node: Tensor, link: Tensor, start: Tensor, end: Tensor
    ) -> tuple[Tensor, Tensor]:
        h = relu(self.node_in((node - self.node_mean) / self.node_scale))
        e = relu(self.link_in((link - self.link_mean) / self.link_scale))
        for step in self.rounds:
            h, e = step(h, e, start, end)
        both = torch.cat([e, *ends(h, start, end)], 1)
        return self.node_out(h)[:, 0], self.link_out(both)[:, 0]


def ends(h: Tensor, start: Tensor, end: Tensor) -> tuple[Tensor, Tensor]:
    """Return what does not tell a link's start from its end."""
    return h[start] + h[end], (h[start] - h[end]).abs()

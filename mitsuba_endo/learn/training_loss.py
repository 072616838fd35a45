"""What the network is trained to make small."""

from typing import NamedTuple

import torch  # pyright: ignore[reportMissingImports]
from torch import Tensor  # pyright: ignore[reportMissingImports]
from torch.nn.functional import (  # pyright: ignore[reportMissingImports]
    binary_cross_entropy_with_logits,
    cross_entropy,
    normalize,
)

from .examples import Example

CODE, CONFIDENCE, EDGE = 0.5, 0.3, 0.5
"""Weights beside the phase's."""
SURE = 0.1
"""Periods of error, on either axis, below which the network should trust itself."""
EDGE_BALANCE = 6.0
"""Weight of an edge pixel: there are few."""


class Losses(NamedTuple):
    """Parts before weighting, each a scalar."""

    phase: Tensor
    code: Tensor
    confidence: Tensor
    edge: Tensor

    @property
    def total(self) -> Tensor:
        weighted = CODE * self.code + CONFIDENCE * self.confidence + EDGE * self.edge
        return self.phase + weighted


def losses(output: Tensor, truth: Example) -> Losses:
    """Return the losses of network output (N, 9, H, W) against a batch of examples.

    Phase: mean chord |exp(i a) - exp(i b)| over lit pixels and both axes, in units of radians for
    small angles; robust, as an absolute error is.
    """
    lit = truth["lit"]
    chord = phase_chord(output[:, :4], truth["lattice"])
    count = lit.sum().clamp(min=1)
    phase = (chord * lit[:, None]).sum() / (2 * count)
    asked = truth["code"].long()
    code = cross_entropy(output[:, 4:7], asked, ignore_index=-1, reduction="sum")
    code = code / (asked >= 0).sum().clamp(min=1)
    right = lit & (chord.detach().amax(1) < 2 * torch.pi * SURE)
    confidence = binary_cross_entropy_with_logits(output[:, 7], right.to(output.dtype))
    balance = torch.tensor(EDGE_BALANCE, device=output.device)
    edge = binary_cross_entropy_with_logits(
        output[:, 8], truth["edge"].to(output.dtype), pos_weight=balance
    )
    return Losses(phase, code, confidence, edge)


def phase_chord(phases: Tensor, lattice: Tensor) -> Tensor:
    """Return the chords (N, 2, H, W) between predicted (N, 4, H, W) and true phases.

    The predictions are (sin u, cos u, sin v, cos v) of any length; the truth is in periods.
    """
    predicted = normalize(phases.unflatten(1, (2, 2)), dim=2, eps=1e-4)
    angle = 2 * torch.pi * lattice
    true = torch.stack([torch.sin(angle), torch.cos(angle)], 2)
    # The root has no derivative at zero.
    return ((predicted - true).square().sum(2) + 1e-6).sqrt()

"""What the network says of each pixel."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError

CHANNELS = (
    "sin_u", "cos_u", "sin_v", "cos_v", "code_R", "code_S", "code_L", "confidence", "edge",
)  # fmt: skip
SMOOTHING = 1.0
"""Standard deviation, pixels: far below a period, above the network's noise from pixel to pixel."""
CODES = (1, 0, -1)
"""Codes in the order of their channels: R, S, L."""


@dataclass(frozen=True, eq=False)
class Heads:
    """The network's outputs with their units."""

    phase: NDArray[np.float32]
    """(H, W, 2) place within the grid's period along x and y, periods in [-1/2, 1/2]."""
    code: NDArray[np.float32]
    """(3, H, W) probabilities of R, S, L, meant near nodes."""
    confidence: NDArray[np.float32]
    """(H, W) probability that the pixel is lit and its phase right."""
    edge: NDArray[np.float32]
    """(H, W) probability that the pixel lies on a depth edge."""


def read_heads(output: NDArray[np.float32], channels: Sequence[str]) -> Heads:
    """Return the heads of a network's output (K, H, W), whose channels have these names.

    Raises:
        InputError: a channel is missing.
    """
    missing = [name for name in CHANNELS if name not in channels]
    if missing or len(channels) != len(output):
        what = f"output {missing[0]} is missing" if missing else f"has {len(output)} outputs"
        raise InputError(what, "decoder network", "use the weights of this version")
    at = {name: output[channels.index(name)] for name in CHANNELS}
    turns = [np.arctan2(at[f"sin_{axis}"], at[f"cos_{axis}"]) / (2 * np.pi) for axis in "uv"]
    logits = np.stack([at[f"code_{letter}"] for letter in "RSL"])
    exponential = np.exp(logits - logits.max(0))
    return Heads(
        phase=np.stack(turns, -1).astype(np.float32),
        code=exponential / exponential.sum(0),
        confidence=_sigmoid(at["confidence"]),
        edge=_sigmoid(at["edge"]),
    )


def smoothed(heads: Heads) -> Heads:
    """Return heads whose phase is averaged over a pixel around by confidence, on the circle."""
    weight = np.maximum(heads.confidence, 1e-3)[..., None]
    angle = 2 * np.pi * heads.phase
    parts = (cv2.GaussianBlur(f(angle) * weight, (0, 0), SMOOTHING) for f in (np.sin, np.cos))
    turns = np.arctan2(*parts) / (2 * np.pi)
    return replace(heads, phase=turns.astype(np.float32))


def _sigmoid(logit: NDArray[np.float32]) -> NDArray[np.float32]:
    return (0.5 + 0.5 * np.tanh(0.5 * logit)).astype(np.float32)

"""From an image of the coded grid to projector coordinates."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..agreement import agreeing
from ..grid_pattern import CodedGrid
from ..normalise import one_channel
from .graph import GridGraph, build_graph
from .heads import Heads, smoothed
from .identify import Identity, identify
from .network import Network
from .nodes import larger
from .unwrap import unwrap

FEW_NODES = 9
"""With fewer, an image shows no grid."""
SURE = 1e-3
"""Doubt, one less the confidence, under which coordinates are no better known."""
DARK = 8 / 255
"""An image whose brightest hundredth is below that is called dark."""
SATURATED = 254.5 / 255


@dataclass(frozen=True, eq=False)
class DecodedGrid:
    """What one image says."""

    q: NDArray[np.float32]
    """(H, W, 2) pattern pixels (x, y), integer = pixel centre, NaN = not known."""
    confidence: NDArray[np.float32]
    """(H, W) probability that the coordinate is right to a tenth of a period, 0 = not known."""
    graph: GridGraph
    identity: Identity
    reason: str
    """Why nothing was decoded; empty if something was."""

    @property
    def weight(self) -> NDArray[np.float32]:
        """(H, W) 1 / variance of the coordinate relative to the best, 0 = not known.

        The standard deviation is taken to grow with the cube root of the doubt. On the training's
        clean validation views it is 0.09, 0.13, 0.17, 0.28, 0.50 and 0.78 pattern pixels at doubts
        of up to 0.001 and of 0.003, 0.007, 0.03, 0.14 and 0.39. In heavily corrupted ones it grows
        from 0.20 to 0.61 only: there the weights differ more than they should.
        """
        doubt = np.maximum(1 - self.confidence, SURE)
        return np.where(self.confidence > 0, (SURE / doubt) ** (2 / 3), 0).astype(np.float32)

    @property
    def nodes(self) -> int:
        """Number of nodes of the grid: all that closed quads join, or that were identified."""
        return int(((self.graph.component >= 0) | self.identity.placed).sum())

    @property
    def coverage(self) -> float:
        """Share of the pixels that have a coordinate."""
        return float(np.isfinite(self.q[..., 0]).mean())


def decode_image(
    image: NDArray[np.integer] | NDArray[np.floating], network: Network, pattern: CodedGrid
) -> DecodedGrid:
    """Decode one image (H, W) or (H, W, 3), 8 or 16 bit, or floats where 1 is full scale.

    Where nothing is decoded, the result says why: it is no error.

    Raises:
        InputError: not an image.
    """
    decoded = decode_heads(network.heads(image), pattern)
    light = "" if not decoded.reason else _fault_of_light(one_channel(image))
    return replace(decoded, reason=f"{light}{decoded.reason}")


def _fault_of_light(gray: NDArray[np.float32]) -> str:
    if np.quantile(gray, 0.99) < DARK:
        return "the image is dark: "
    if (gray >= SATURATED).mean() > 0.5:
        return "the image is saturated: "
    return ""


def decode_heads(heads: Heads, pattern: CodedGrid) -> DecodedGrid:
    """Decode the network's outputs for one image.

    Raises:
        InputError: no code of the pattern's size was found.
    """
    heads = smoothed(heads)
    graph = build_graph(heads)
    identity = identify(graph, pattern.code)
    lattice = unwrap(heads, graph.nodes, identity)
    q = pattern.pixels(lattice).astype(np.float32)
    half = np.array([pattern.width, pattern.height], np.float32) / 2
    q[larger((q - half + 0.5) / half) > 1] = np.nan
    q[~agreeing(q, slack=pattern.period / 8)] = np.nan
    known = np.isfinite(q[..., 0])
    confidence = np.where(known, heads.confidence, 0).astype(np.float32)
    return DecodedGrid(q, confidence, graph, identity, "" if known.any() else _reason(graph))


def _reason(graph: GridGraph) -> str:
    linked = int((graph.component >= 0).sum())
    if linked < FEW_NODES:
        return "no grid was found"
    return f"a grid of {linked} nodes was found, but not this pattern's code"

"""From an image of the coded grid to projector coordinates."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ..consistency import locally_consistent
from ..grid_pattern import CodedGrid
from ..network import Heads, Network
from ..normalise import one_channel
from .grid_graph import GridGraph, build_graph, larger
from .node_assignment import NodeAssignment, assign_nodes
from .phase_unwrapping import unwrap
from .settings import MatcherSettings

DEFAULTS = MatcherSettings()


@dataclass(frozen=True, eq=False)
class DecodedGrid:
    """What one image says."""

    q: NDArray[np.float32]
    """(H, W, 2) pattern pixels (x, y), integer = pixel centre, NaN = not known."""
    confidence: NDArray[np.float32]
    """(H, W) probability that the coordinate is right to a tenth of a period, 0 = not known."""
    graph: GridGraph
    assignment: NodeAssignment
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
        least = DEFAULTS.least_doubt
        doubt = np.maximum(1 - self.confidence, least)
        return np.where(self.confidence > 0, (least / doubt) ** (2 / 3), 0).astype(np.float32)

    @property
    def nodes(self) -> int:
        """Number of nodes of the grid: all that closed quads join, or that were assigned."""
        return int(((self.graph.component >= 0) | self.assignment.assigned).sum())

    @property
    def coverage(self) -> float:
        """Share of the pixels that have a coordinate."""
        return float(np.isfinite(self.q[..., 0]).mean())


def decode_image(
    image: NDArray[np.integer] | NDArray[np.floating],
    network: Network,
    pattern: CodedGrid,
    settings: MatcherSettings = DEFAULTS,
) -> DecodedGrid:
    """Decode one image (H, W) or (H, W, 3), 8 or 16 bit, or floats where 1 is full scale.

    Where nothing is decoded, the result says why: it is no error.

    Raises:
        InputError: not an image.
    """
    decoded = decode_heads(network.heads(image), pattern, settings)
    light = "" if not decoded.reason else _fault_of_light(one_channel(image), settings)
    return replace(decoded, reason=f"{light}{decoded.reason}")


def _fault_of_light(gray: NDArray[np.float32], settings: MatcherSettings) -> str:
    if np.quantile(gray, settings.brightest) < settings.dark:
        return "the image is dark: "
    if (gray >= settings.saturated).mean() > 0.5:
        return "the image is saturated: "
    return ""


def decode_heads(
    heads: Heads, pattern: CodedGrid, settings: MatcherSettings = DEFAULTS
) -> DecodedGrid:
    """Decode the network's outputs for one image.

    Raises:
        InputError: no code of the pattern's size was found.
    """
    heads = smoothed(heads, settings.phase_smoothing)
    graph = build_graph(heads, settings)
    assignment = assign_nodes(graph, pattern.code, settings)
    lattice = unwrap(heads, graph.nodes, assignment, settings)
    q = pattern.pixels(lattice).astype(np.float32)
    half = np.array([pattern.width, pattern.height], np.float32) / 2
    q[larger((q - half + 0.5) / half) > 1] = np.nan
    q[~locally_consistent(q, pattern.period * settings.neighbour_slack)] = np.nan
    valid = np.isfinite(q[..., 0])
    confidence = np.where(valid, heads.confidence, 0).astype(np.float32)
    reason = "" if valid.any() else _reason(graph, settings.least_nodes)
    return DecodedGrid(q, confidence, graph, assignment, reason)


def smoothed(heads: Heads, sigma: float) -> Heads:
    """Return heads whose phase is averaged over ``sigma`` pixels by confidence, on the circle."""
    weight = np.maximum(heads.confidence, 1e-3)[..., None]
    angle = 2 * np.pi * heads.phase
    parts = (cv2.GaussianBlur(f(angle) * weight, (0, 0), sigma) for f in (np.sin, np.cos))
    turns = np.arctan2(*parts) / (2 * np.pi)
    return replace(heads, phase=turns.astype(np.float32))


def _reason(graph: GridGraph, least: int) -> str:
    linked = int((graph.component >= 0).sum())
    if linked < least:
        return "no grid was found"
    return f"a grid of {linked} nodes was found, but not this pattern's code"

"""How good the network is, per pixel, before graph and vote."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ..decoding.network import Heads
from .compose import Targets

CONFIDENT = 0.5
"""Confidence from which a pixel is accepted: right is then likelier than wrong."""
GROSS = 0.25
"""Periods of error of a pixel that misleads the graph."""
EDGE_PRESENT = 0.5
"""Probability from which a pixel counts as a depth edge."""


@dataclass(frozen=True)
class PixelMetrics:
    """Errors are per axis, in grid periods, over the accepted pixels of all images together."""

    median: float
    p95: float
    gross: float
    """Share of accepted pixels with an error above a quarter period on either axis."""
    coverage: float
    """Accepted share of the lit pixels."""
    code_right: float
    """Share of right codes, at lit pixels near nodes."""
    false_share: float
    """Accepted share of the pixels that the grid does not light."""
    edge_recall: float
    edge_precision: float

    @classmethod
    def names(cls) -> list[str]:
        return [f.name for f in fields(cls)]


def pixel_metrics(heads: Sequence[Heads], truths: Sequence[Targets]) -> PixelMetrics:
    """Compare what the network says of images with their truths."""
    parts = [_compare(h, t) for h, t in zip(heads, truths, strict=True)]
    error = np.concatenate([p[0] for p in parts])
    lit, accepted_lit, unlit, accepted_unlit, asked, right, edges, detected, both = (
        sum(p[1][k] for p in parts) for k in range(9)
    )
    share = np.percentile(error, [50, 95]) if error.size else np.full(2, np.nan)
    return PixelMetrics(
        median=float(share[0]),
        p95=float(share[1]),
        gross=float((error.max(1) > GROSS).mean()) if error.size else float("nan"),
        coverage=accepted_lit / max(lit, 1),
        code_right=right / max(asked, 1),
        false_share=accepted_unlit / max(unlit, 1),
        edge_recall=both / max(edges, 1),
        edge_precision=both / max(detected, 1),
    )


def phase_error(heads: Heads, truth: Targets) -> NDArray[np.float32]:
    """Return the error (H, W, 2) in periods, 0 to 1/2."""
    away = heads.phase - truth.lattice.transpose(1, 2, 0)
    return np.abs(away - np.round(away)).astype(np.float32)


def _compare(heads: Heads, truth: Targets) -> tuple[NDArray[np.float32], tuple[int, ...]]:
    accepted, detected = heads.confidence > CONFIDENT, heads.edge > EDGE_PRESENT
    asked = truth.code >= 0
    right = asked & (heads.code.argmax(0) == truth.code)
    error = phase_error(heads, truth)[accepted & truth.lit]
    counts = (
        truth.lit, accepted & truth.lit, ~truth.lit, accepted & ~truth.lit, asked, right,
        truth.edge, detected, detected & truth.edge,
    )  # fmt: skip
    return error, tuple(int(c.sum()) for c in counts)

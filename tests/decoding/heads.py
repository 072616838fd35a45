"""What a network might say of a view, made from the truth: its errors are chosen by the test.

Across depth edges a network sees one smooth surface: the phase is blurred over them, and it is as
confident there as anywhere. Codes are misread, and the phase is noisy.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.decoding.network import CHANNELS


@dataclass(frozen=True)
class Errors:
    """How wrong the network is."""

    phase: float = 0.015
    """Standard deviation, periods."""
    flips: float = 0.05
    """Share of the nodes whose code is misread, with conviction."""
    blur: float = 1.5
    """Pixels over which the phase is smoothed, across depth edges too."""
    missed: float = 0.4
    """Share of the depth edges' length that is not seen."""
    holes: float = 0.0
    """Share of the image where the network has no confidence, in blobs."""


def network_output(
    q: NDArray[np.floating], pattern: CodedGrid, errors: Errors, seed: int = 0
) -> NDArray[np.float32]:
    """Return (9, H, W) in the order of CHANNELS for exact coordinates (H, W, 2)."""
    rng = np.random.default_rng(seed)
    truth = pattern.truth(q)
    lit = np.isfinite(truth.phase[..., 0])
    turn = np.exp(1j * np.nan_to_num(truth.phase)) * lit[..., None]
    turn = _blurred(turn, errors.blur) + 1e-9
    noise = gaussian_filter(rng.standard_normal(q.shape), (1, 1, 0))
    angle = np.angle(turn) + 2 * np.pi * errors.phase * noise / noise.std()
    edge = _seen(depth_edges(truth.lattice), errors.missed, rng)
    sure = lit.copy()
    if errors.holes:
        blobs = gaussian_filter(rng.random(lit.shape), 4)
        sure &= blobs > np.quantile(blobs, errors.holes)
    output = np.zeros((len(CHANNELS), *lit.shape), np.float32)
    for axis in (0, 1):
        output[2 * axis] = np.sin(angle[..., axis])
        output[2 * axis + 1] = np.cos(angle[..., axis])
    output[4:7] = _logits(truth.node, truth.code, pattern, errors.flips, rng)
    output[7] = np.where(sure, 3, -3)
    output[8] = np.where(edge, 3, -3)
    return output


def depth_edges(lattice: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return pixels (H, W) beside a jump of more than a quarter of a period, or of light."""
    edge = np.zeros(lattice.shape[:2], bool)
    for axis in (0, 1):
        jump = ~(np.abs(np.diff(lattice, axis=axis)).max(-1) < 0.25)
        first, second = (slice(None, -1), slice(1, None))
        edge[first if axis == 0 else (slice(None), first)] |= jump
        edge[second if axis == 0 else (slice(None), second)] |= jump
    return edge & np.isfinite(lattice[..., 0])


def _blurred(turn: NDArray[np.complex128], sigma: float) -> NDArray[np.complex128]:
    if not sigma:
        return turn
    return gaussian_filter(turn.real, (sigma, sigma, 0)) + 1j * gaussian_filter(
        turn.imag, (sigma, sigma, 0)
    )


def _seen(edge: NDArray[np.bool_], missed: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    blobs = gaussian_filter(rng.random(edge.shape), 6)
    return edge & (blobs > np.quantile(blobs, missed))


def _logits(
    node: NDArray[np.int32],
    code: NDArray[np.int8],
    pattern: CodedGrid,
    flips: float,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Misread whole nodes, not pixels."""
    wrong = rng.random((pattern.rows, pattern.columns)) < flips
    other = rng.integers(1, 3, wrong.shape)
    klass = np.where(wrong[node[..., 1], node[..., 0]], other[node[..., 1], node[..., 0]], 0)
    klass = (1 - code + klass) % 3
    return np.where(klass == np.arange(3)[:, None, None], 3.0, 0.0).astype(np.float32)

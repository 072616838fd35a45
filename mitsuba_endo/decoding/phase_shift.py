"""Phase shift along one axis: its images, the wrapped phase, and temporal unwrapping.

Formulas: C. Zuo et al., "Phase shifting algorithms for fringe projection profilometry: a review",
Optics and Lasers in Engineering 109 (2018), and "Temporal phase unwrapping algorithms", 85 (2016).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_DEVIATION = 0.35
"""Periods by which a coarse coordinate may miss the fine one; at 0.5 the fringe is a guess."""
SEAM = 0.02
"""Pixels this near, in periods, to where the coarsest phase wraps may lie at either end."""


@dataclass(frozen=True)
class PhaseConvention:
    """Image k of N shows 1/2 + 1/2 cos(2 pi (q / period + sign k / N + offset))."""

    sign: int = 1
    """1 if the fringes move towards smaller coordinates from image to image, else -1."""
    offset: float = 0.0
    """Turns: 0 for a cosine, 3/4 for a sine; a first shift by a step adds sign / N."""


COSINE = PhaseConvention()


def _turns(steps: int, convention: PhaseConvention) -> NDArray[np.float64]:
    return 2 * np.pi * convention.sign * np.arange(steps) / steps


def phase_images(
    size: int, period: float, steps: int, convention: PhaseConvention = COSINE
) -> NDArray[np.float32]:
    """Return the profiles of a convention's images along the axis, (steps, size)."""
    angle = 2 * np.pi * (np.arange(size) / period + convention.offset)
    return (0.5 + 0.5 * np.cos(angle + _turns(steps, convention)[:, None])).astype(np.float32)


def wrapped_coordinate(
    images: NDArray[np.float32], period: float, convention: PhaseConvention = COSINE
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return q modulo the period and the peak-to-peak contrast, both (...).

    Args:
        images: (steps, ...), at least three equal steps of one whole turn, linear brightness.
        period: pattern pixels.
        convention: of the images.
    """
    turns = _turns(len(images), convention)
    cosine = np.tensordot(np.cos(turns), images, axes=1)
    sine = -np.tensordot(np.sin(turns), images, axes=1)
    share = np.arctan2(sine, cosine) / (2 * np.pi) - convention.offset
    swing = 4 / len(images) * np.hypot(sine, cosine)
    return (np.mod(share, 1) * period).astype(np.float32), swing.astype(np.float32)


def phase_noise(
    swing: NDArray[np.floating], noise: float, period: float, steps: int
) -> NDArray[np.floating]:
    """Return the standard deviation of a coordinate, pattern pixels.

    That of the phase is noise / amplitude sqrt(2 / N) (Zuo 2018, section 2).

    Args:
        swing: peak-to-peak contrast.
        noise: standard deviation of an image's brightness.
        period: pattern pixels.
        steps: N.
    """
    amplitude = np.maximum(swing, 1e-6) / 2
    return period / (2 * np.pi) * np.sqrt(2 / steps) * noise / amplitude


def unroll_coarsest(
    coordinate: NDArray[np.float32], period: float, size: int
) -> NDArray[np.float32]:
    """Place a coordinate of a period that spans the pattern; NaN where it may be either end."""
    seam = (size - 1 + period) / 2
    to_seam = np.abs(np.mod(coordinate - seam + period / 2, period) - period / 2)
    q = np.where(coordinate > seam, coordinate - period, coordinate)
    return np.where(to_seam < SEAM * period, np.nan, q).astype(np.float32)


def refine(
    coarse: NDArray[np.float32],
    coordinate: NDArray[np.float32],
    period: float,
    most: float = MAX_DEVIATION,
) -> NDArray[np.float32]:
    """Return the coordinate of a finer period next to the coarse one; NaN where they disagree.

    Args:
        coarse: pattern pixels.
        coordinate: of the finer period, modulo it.
        period: pattern pixels.
        most: periods by which they may disagree.
    """
    apart = (coarse - coordinate) / period
    fringe = np.round(apart)
    q = coordinate + fringe * period
    return np.where(np.abs(apart - fringe) > most, np.nan, q).astype(np.float32)

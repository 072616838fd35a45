"""Phase shift along one axis: its images, the wrapped phase, and temporal unwrapping.

Formulas: C. Zuo et al., "Phase shifting algorithms for fringe projection profilometry: a review",
Optics and Lasers in Engineering 109 (2018), and "Temporal phase unwrapping algorithms", 85 (2016).
"""

import numpy as np
from numpy.typing import NDArray

MAX_DEVIATION = 0.35
"""Periods by which a coarse coordinate may miss the fine one; at 0.5 the fringe is a guess."""
SEAM = 0.02
"""Pixels this near, in periods, to where the coarsest phase wraps may lie at either end."""


def phase_images(size: int, period: float, steps: int) -> NDArray[np.float32]:
    """Return 1/2 + 1/2 cos(2 pi q / period + 2 pi k / steps) along the axis, (steps, size)."""
    angle = 2 * np.pi * np.arange(size) / period
    shift = 2 * np.pi * np.arange(steps)[:, None] / steps
    return (0.5 + 0.5 * np.cos(angle + shift)).astype(np.float32)


def wrapped_coordinate(
    images: NDArray[np.float32], period: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return q modulo the period and the peak-to-peak contrast, both (H, W).

    Args:
        images: (steps, H, W), at least three equal steps of one whole turn, linear brightness.
        period: pattern pixels.
    """
    shift = 2 * np.pi * np.arange(len(images)) / len(images)
    cosine = np.tensordot(np.cos(shift), images, axes=1)
    sine = -np.tensordot(np.sin(shift), images, axes=1)
    coordinate = np.mod(np.arctan2(sine, cosine) / (2 * np.pi), 1) * period
    return coordinate.astype(np.float32), (4 / len(images) * np.hypot(sine, cosine)).astype(
        np.float32
    )


def unroll_coarsest(
    coordinate: NDArray[np.float32], period: float, size: int
) -> NDArray[np.float32]:
    """Place a coordinate of a period that spans the pattern; NaN where it may be either end."""
    seam = (size - 1 + period) / 2
    to_seam = np.abs(np.mod(coordinate - seam + period / 2, period) - period / 2)
    q = np.where(coordinate > seam, coordinate - period, coordinate)
    return np.where(to_seam < SEAM * period, np.nan, q).astype(np.float32)


def refine(
    coarse: NDArray[np.float32], coordinate: NDArray[np.float32], period: float
) -> NDArray[np.float32]:
    """Return the coordinate of a finer period next to the coarse one; NaN where they disagree."""
    apart = (coarse - coordinate) / period
    fringe = np.round(apart)
    q = coordinate + fringe * period
    return np.where(np.abs(apart - fringe) > MAX_DEVIATION, np.nan, q).astype(np.float32)

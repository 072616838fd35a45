"""The similarity that brings corresponding points together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..robust import robust_std

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Similarity:
    """x_out = scale R x_in + t."""

    scale: float
    R: Floats
    """(3, 3) rotation."""
    t: Floats
    """(3,), the unit of x_out."""

    @classmethod
    def identity(cls) -> "Similarity":
        return cls(1.0, np.eye(3), np.zeros(3))

    def apply(self, points: Floats) -> Floats:
        """Transform points (..., 3)."""
        return self.scale * points @ self.R.T + self.t


def align(
    source: Floats,
    target: Floats,
    weights: Floats | None = None,
    *,
    scale: bool = True,
    rotation: bool = True,
) -> Similarity:
    """Return the similarity that minimises sum w |target - (scale R source + t)|^2.

    Source: S. Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 1991, with weights.

    Args:
        source: (N, 3) points.
        target: (N, 3) points that correspond to them.
        weights: (N,) not negative; default equal.
        scale: whether the scale is free, else 1.
        rotation: whether R and t are free, else the identity: a scaling about the origin.

    Raises:
        ValueError: fewer than three points with weight where a rotation is asked for.
    """
    w = np.ones(len(source)) if weights is None else weights
    if not rotation:
        s = np.sum(w[:, None] * source * target) / np.sum(w[:, None] * source * source)
        return Similarity(float(s) if scale else 1.0, np.eye(3), np.zeros(3))
    if np.count_nonzero(w) < 3:
        raise ValueError("a rotation needs at least three points")
    w = w / w.sum()
    source_mean, target_mean = w @ source, w @ target
    a, b = source - source_mean, target - target_mean
    u, spread, vt = np.linalg.svd((w[:, None] * b).T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    R = (u * sign) @ vt
    s = float(spread @ sign / np.sum(w[:, None] * a * a)) if scale else 1.0
    return Similarity(s, R, target_mean - s * R @ source_mean)


def align_robustly(
    source: Floats, target: Floats, *, scale: bool, rotation: bool, steps: int = 3
) -> Similarity:
    """As :func:`align`, leaving out pairs that a depth step tore apart.

    Both points of a pair lie on one camera ray; at a step one surface may be hit before it and the
    other behind. After each fit, pairs farther apart than five robust standard deviations
    are left out of the next.
    """
    kept = np.ones(len(source))
    similarity = align(source, target, scale=scale, rotation=rotation)
    for _ in range(steps):
        apart = np.linalg.norm(target - similarity.apply(source), axis=-1)
        kept = (apart <= 5 * robust_std(apart)).astype(float)
        similarity = align(source, target, kept, scale=scale, rotation=rotation)
    return similarity

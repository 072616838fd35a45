"""Omnidirectional camera with a polynomial."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Array, namespace
from .registry import register_camera

_NEWTON_STEPS = 12
"""From the angle itself as the radius: quadratic, so that rounding remains well before."""
_TERMS = 6
"""b1 to b4, d, e."""


@register_camera
class Scaramuzza:
    """Polynomial of the radius with the coefficients (b1, b2, b3, b4, d, e), beyond 180 degrees.

    The normalised image point (a, b) = (x + e y, y + d x) sees the direction
    (x, y, 1 + b1 r + b2 r^2 + b3 r^3 + b4 r^4) with r^2 = x^2 + y^2. OCamCalib's a0, ..., a4 in
    pixels become fx = |a0| and b_k = a_k |a0|^k / a0, so that the direction along the axis is
    (0, 0, 1); its c is fy / fx, and its d is here d / c. Source: Scaramuzza, Martinelli, Siegwart,
    "A Flexible Technique for Accurate Omnidirectional Camera Calibration and Structure from
    Motion", ICVS 2006.
    """

    name: ClassVar[str] = "scaramuzza"
    max_coefficients: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4, 6)
    coefficients: ClassVar[tuple[str, ...]] = ("b1", "b2", "b3", "b4", "d", "e")

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        *_, d, e = _padded(coefficients)
        xp = namespace(x, y, z)
        r2 = x * x + y * y
        off_axis = r2 > 0
        length = xp.sqrt(xp.where(off_axis, r2, 1.0))
        radius = self._radius(coefficients, xp.atan2(length, z))
        scale = xp.where(off_axis, radius / length, 1 / xp.where(off_axis, 1.0, z))
        return scale * (x + e * y), scale * (y + d * x)

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        *_, d, e = _padded(coefficients)
        xp = namespace(a, b)
        x, y = (a - e * b) / (1 - d * e), (b - d * a) / (1 - d * e)
        r2 = x * x + y * y
        off_axis = r2 > 0
        depth, _ = _polynomial(coefficients, xp.sqrt(xp.where(off_axis, r2, 1.0)))
        return x, y, xp.where(off_axis, depth, 1.0)

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """Area r dr dphi over solid angle sin(theta) dtheta dphi, and of the skewed axes."""
        *_, d, e = _padded(coefficients)
        xp = namespace(x, y, z)
        r2 = x * x + y * y
        off_axis = r2 > 0
        length = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta = xp.atan2(length, z)
        radius = self._radius(coefficients, theta)
        depth, slope = _polynomial(coefficients, radius)
        rise = depth - radius * slope  # of the angle with the radius, times r^2 + depth^2
        area = radius * (radius * radius + depth * depth) / rise
        area = area * xp.sqrt(r2 + z * z) / length * xp.abs(1 - d * e)
        solved = xp.abs(xp.atan2(radius, depth) - theta) < _SOLVED
        mask = xp.where(off_axis, (rise > 0) & (radius > 0) & solved, z > 0)
        return xp.where(off_axis, area, xp.abs(1 - d * e)), mask

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        return True

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        return float(self._radius(coefficients, np.float64(angle)))

    def _radius(self, coefficients: Sequence[Array], theta: Array) -> Array:
        """Return r with atan2(r, polynomial(r)) = theta, by Newton's method.

        In Dr.Jit only the last step is differentiated, as in :class:`..distortion.BrownDistortion`.
        """
        xp = namespace(theta, *coefficients)
        frozen = [xp.detach(c) for c in coefficients]
        target = xp.detach(theta)
        radius = target
        for _ in range(_NEWTON_STEPS):
            depth, slope = _polynomial(frozen, radius)
            rise = (depth - radius * slope) / (radius * radius + depth * depth)
            radius = radius - (xp.atan2(radius, depth) - target) / rise
        radius = xp.detach(radius)
        depth, slope = _polynomial(frozen, radius)
        rise = (depth - radius * slope) / (radius * radius + depth * depth)
        return radius - (xp.atan2(radius, _polynomial(coefficients, radius)[0]) - theta) / rise


_SOLVED = 1e-4
"""Radians within which Newton's method counts as solved: rounding in single precision is below."""


def _polynomial(coefficients: Sequence[Array], r: Array) -> tuple[Array, Array]:
    """Return 1 + b1 r + ... + b4 r^4 and its derivative."""
    b1, b2, b3, b4, *_ = _padded(coefficients)
    depth = 1 + r * (b1 + r * (b2 + r * (b3 + r * b4)))
    return depth, b1 + r * (2 * b2 + r * (3 * b3 + r * 4 * b4))


def _padded(coefficients: Sequence[Array]) -> list[Array]:
    return [*coefficients, *[0.0] * (_TERMS - len(coefficients))]

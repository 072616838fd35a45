"""Double sphere."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Array, namespace
from .registry import register_camera


@register_camera
class DoubleSphere:
    """Double sphere with the coefficients (xi, alpha), beyond 180 degrees.

    A point is projected onto a unit sphere, onto a second one shifted by xi, and from a centre
    shifted by alpha / (1 - alpha) into the image. Source: Usenko, Demmel, Cremers, "The Double
    Sphere Camera Model", 3DV 2018, equations 40 to 50.
    """

    name: ClassVar[str] = "double_sphere"
    max_coefficients: ClassVar[tuple[int, ...]] = (2,)
    coefficients: ClassVar[tuple[str, ...]] = ("xi", "alpha")

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        bottom, _ = self._bottom(coefficients, x, y, z)
        return x / bottom, y / bottom

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        xi, alpha = coefficients
        xp = namespace(a, b)
        r2 = a * a + b * b
        root = xp.sqrt(1 - (2 * alpha - 1) * r2)
        mz = (1 - alpha * alpha * r2) / (alpha * root + 1 - alpha)
        scale = (mz * xi + xp.sqrt(mz * mz + (1 - xi * xi) * r2)) / (mz * mz + r2)
        return scale * a, scale * b, scale * mz - xi

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """With r = sin(theta) / B the area is r dr dphi over sin(theta) dtheta dphi."""
        xi, alpha = coefficients
        xp = namespace(x, y, z)
        length = xp.sqrt(x * x + y * y + z * z)
        cosine = z / length
        bottom, second = self._bottom(coefficients, x / length, y / length, cosine)
        square = (x * x + y * y) / (length * length)
        rise = cosine * bottom + square * (alpha * xi / second + 1 - alpha)
        area = rise / (bottom * bottom * bottom)
        return area, self.projectable(coefficients, x, y, z) & (rise > 0)

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        """Return where the last centre sees the point on the second sphere.

        That point's cosine must exceed -w (the paper's w1); carried back to the first sphere. The
        paper's own bound (equation 43) leaves out directions up to 3 degrees within it.
        """
        xi, alpha = coefficients
        xp = namespace(x, y, z, xi, alpha)
        # Written so that neither alpha = 0 nor alpha = 1 divides by zero.
        w = xp.minimum(alpha, 1 - alpha) / xp.maximum(alpha, 1 - alpha)
        least = w * xi * w - xi - w * xp.sqrt(1 - xi * xi * (1 - w * w))
        return z > least * xp.sqrt(x * x + y * y + z * z)

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        return float(self.normalise(coefficients, np.sin(angle), 0.0, np.cos(angle))[0])

    def _bottom(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """Return B and the distance from the second sphere's centre."""
        xi, alpha = coefficients
        xp = namespace(x, y, z)
        shifted = xi * xp.sqrt(x * x + y * y + z * z) + z
        second = xp.sqrt(x * x + y * y + shifted * shifted)
        return alpha * second + (1 - alpha) * shifted, second

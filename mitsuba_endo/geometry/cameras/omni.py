"""Unified omnidirectional camera."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Array, namespace
from ..brown_distortion import BrownDistortion
from .registry import MIN_COSINE, register_camera


@register_camera
class Omni:
    """Unified sphere model with the coefficients (xi, k1, k2, p1, p2, k3), beyond 180 degrees.

    A point is projected onto a unit sphere, from a centre shifted by xi onto a plane, and distorted
    there after Brown. Source: Mei and Rives, "Single View Point Omnidirectional Camera Calibration
    from Planar Grids", ICRA 2007; as in OpenCV's ``omnidir`` and Kalibr's ``omni-radtan``.
    """

    name: ClassVar[str] = "omni"
    max_coefficients: ClassVar[tuple[int, ...]] = (1, 2, 3, 4, 5, 6)
    coefficients: ClassVar[tuple[str, ...]] = ("xi", "k1", "k2", "p1", "p2", "k3")

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        xi, *brown = coefficients
        shifted = z + xi * namespace(x, y, z).sqrt(x * x + y * y + z * z)
        return BrownDistortion(brown).apply(x / shifted, y / shifted)

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        xi, *brown = coefficients
        x, y = BrownDistortion(brown).remove(a, b)
        r2 = x * x + y * y
        scale = (xi + namespace(x, y).sqrt(1 + (1 - xi * xi) * r2)) / (1 + r2)
        return scale * x, scale * y, scale - xi

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """With m = sin(theta) / (cos(theta) + xi): area m dm dphi, times Brown's determinant."""
        xi, *coefficients_of_brown = coefficients
        brown = BrownDistortion(coefficients_of_brown)
        xp = namespace(x, y, z)
        cosine = z / xp.sqrt(x * x + y * y + z * z)
        shifted = cosine + xi
        scale = shifted * xp.sqrt(x * x + y * y + z * z)
        jxx, jxy, jyy = brown.jacobian(x / scale, y / scale)
        rise = 1 + xi * cosine
        area = rise / (shifted * shifted * shifted) * xp.abs(jxx * jyy - jxy * jxy)
        return area, (shifted > 0) & (rise > 0) & brown.unfolded(x / scale, y / scale)

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        length = namespace(x, y, z).sqrt(x * x + y * y + z * z)
        return z + coefficients[0] * length > MIN_COSINE * length

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        return float(np.sin(angle) / (np.cos(angle) + coefficients[0]))

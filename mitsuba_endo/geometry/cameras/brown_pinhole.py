"""Pinhole with Brown distortion."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from ..arrays import Array, namespace
from ..brown_distortion import BrownDistortion
from .registry import MIN_COSINE, register_camera


@register_camera
class OpenCVCamera:
    """Pinhole with Brown distortion of up to 8 terms (OpenCV ``calib3d``)."""

    name: ClassVar[str] = "opencv"
    max_coefficients: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4, 5, 8)
    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        return BrownDistortion(coefficients).apply(x / z, y / z)

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        x, y = BrownDistortion(coefficients).remove(a, b)
        return x, y, 1 + 0 * x

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        xp = namespace(x, y, z)
        brown = BrownDistortion(coefficients)
        jxx, jxy, jyy = brown.jacobian(x / z, y / z)
        cosine = z / xp.sqrt(x * x + y * y + z * z)
        area = xp.abs(jxx * jyy - jxy * jxy) / (cosine * cosine * cosine)
        return area, (z > 0) & brown.unfolded(x / z, y / z)

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        return z > MIN_COSINE * namespace(x, y, z).sqrt(x * x + y * y + z * z)

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        return float(np.tan(angle))

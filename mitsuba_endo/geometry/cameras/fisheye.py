"""Equidistant fisheye."""

from collections.abc import Sequence
from typing import ClassVar

from ..arrays import Array, namespace
from ..kannala_brandt_distortion import KannalaBrandtDistortion
from .registry import register_camera


@register_camera
class OpenCVFisheye:
    """Equidistant fisheye with four terms (OpenCV ``fisheye``), also beyond 180 degrees."""

    name: ClassVar[str] = "opencv_fisheye"
    max_coefficients: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)
    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        xp = namespace(x, y, z)
        r2 = x * x + y * y
        off_axis = r2 > 0
        r = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta_d = KannalaBrandtDistortion(coefficients).apply(xp.atan2(r, z))
        scale = xp.where(off_axis, theta_d / r, 1 / xp.where(off_axis, 1.0, z))
        return scale * x, scale * y

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        xp = namespace(a, b)
        r2 = a * a + b * b
        off_axis = r2 > 0
        theta_d = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta = KannalaBrandtDistortion(coefficients).remove(theta_d)
        scale = xp.where(off_axis, xp.sin(theta) / theta_d, 1.0)
        return scale * a, scale * b, xp.where(off_axis, xp.cos(theta), 1.0)

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """Area theta_d dtheta_d dphi over solid angle sin(theta) dtheta dphi."""
        xp = namespace(x, y, z)
        r2 = x * x + y * y
        off_axis = r2 > 0
        r = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta = xp.atan2(r, z)
        distortion = KannalaBrandtDistortion(coefficients)
        slope = distortion.slope(theta)
        area = distortion.apply(theta) * slope * xp.sqrt(r2 + z * z) / r
        return xp.where(off_axis, area, 1.0), xp.where(off_axis, slope > 0, z > 0)

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        return True

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        return angle

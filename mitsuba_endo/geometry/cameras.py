"""Camera models: pixel to ray and back.

Pixels follow OpenCV: integer = pixel centre. Formulas run on NumPy and Dr.Jit components alike.
Adding a model is one class with ``@register_camera``, and the names of its coefficients in
:data:`mitsuba_endo.rendering.keys.LENSES`, by which scenes give them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, namespace
from .distortion import BrownDistortion, FisheyeDistortion


class CameraLaw(Protocol):
    """Maps directions to normalised distorted image coordinates and back."""

    name: ClassVar[str]
    max_coefficients: ClassVar[tuple[int, ...]]
    """Numbers of distortion coefficients that a file may give."""

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]: ...

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]: ...

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """Return |d(a, b) / d omega| and a mask: on the branch that ``direction`` inverts."""
        ...


CAMERAS: dict[str, CameraLaw] = {}


def register_camera(cls: type) -> type:
    """Class decorator that makes a camera model available under its ``name``."""
    CAMERAS[cls.name] = cls()
    return cls


@register_camera
class OpenCVCamera:
    """Pinhole with Brown distortion of up to 8 terms (OpenCV ``calib3d``)."""

    name: ClassVar[str] = "opencv"
    max_coefficients: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4, 5, 8)

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


@register_camera
class OpenCVFisheye:
    """Equidistant fisheye with four terms (OpenCV ``fisheye``), also beyond 180 degrees."""

    name: ClassVar[str] = "opencv_fisheye"
    max_coefficients: ClassVar[tuple[int, ...]] = (0, 1, 2, 3, 4)

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        xp = namespace(x, y, z)
        r2 = x * x + y * y
        off_axis = r2 > 0
        r = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta_d = FisheyeDistortion(coefficients).apply(xp.atan2(r, z))
        scale = xp.where(off_axis, theta_d / r, 1 / xp.where(off_axis, 1.0, z))
        return scale * x, scale * y

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]:
        xp = namespace(a, b)
        r2 = a * a + b * b
        off_axis = r2 > 0
        theta_d = xp.sqrt(xp.where(off_axis, r2, 1.0))
        theta = FisheyeDistortion(coefficients).remove(theta_d)
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
        fisheye = FisheyeDistortion(coefficients)
        slope = fisheye.slope(theta)
        area = fisheye.apply(theta) * slope * xp.sqrt(r2 + z * z) / r
        return xp.where(off_axis, area, 1.0), xp.where(off_axis, slope > 0, z > 0)


@dataclass(frozen=True, eq=False)
class CameraModel:
    """Camera intrinsics, known and fixed in a calibration."""

    model: str
    """Name in :data:`CAMERAS`."""
    width: int
    height: int
    K: NDArray[np.float64]
    """(3, 3) camera matrix without skew, pixels."""
    distortion: tuple[Array, ...] = ()
    """Coefficients in OpenCV order."""

    def project_xyz(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Project directions in the camera frame to pixels."""
        a, b = CAMERAS[self.model].normalise(self.distortion, x, y, z)
        return self.K[0, 0] * a + self.K[0, 2], self.K[1, 1] * b + self.K[1, 2]

    def direction_uv(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return ray directions (not unit length) in the camera frame of pixels (u, v)."""
        a = (u - self.K[0, 2]) / self.K[0, 0]
        b = (v - self.K[1, 2]) / self.K[1, 1]
        return CAMERAS[self.model].direction(self.distortion, a, b)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project NumPy points (..., 3) of the camera frame to pixels (..., 2)."""
        return np.stack(self.project_xyz(*np.moveaxis(points, -1, 0)), -1)

    def rays(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return NumPy unit directions (..., 3) of pixels (..., 2)."""
        d = np.stack(self.direction_uv(pixels[..., 0], pixels[..., 1]), -1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)

    def pixel_grid(self) -> NDArray[np.float64]:
        """Return the pixel centres (height, width, 2)."""
        x, y = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return np.stack([x, y], -1).astype(np.float64)

    @cached_property
    def grid_rays(self) -> NDArray[np.float64]:
        """Unit directions (height, width, 3) of all pixels, kept: inverting the lens takes long."""
        return self.rays(self.pixel_grid())

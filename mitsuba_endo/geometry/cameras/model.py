"""A camera's intrinsics: pixel to ray and back."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from .registry import CAMERAS


@dataclass(frozen=True, eq=False)
class CameraModel:
    """Camera intrinsics."""

    model: str
    """Name in :data:`CAMERAS`."""
    width: int
    height: int
    K: Any
    """(3, 3) camera matrix without skew, pixels: an array, or nested tuples of Dr.Jit scalars."""
    distortion: tuple[Array, ...] = ()
    """Coefficients in OpenCV order."""

    def project_xyz(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Project directions in the camera frame to pixels."""
        a, b = CAMERAS[self.model].normalise(self.distortion, x, y, z)
        return self.K[0][0] * a + self.K[0][2], self.K[1][1] * b + self.K[1][2]

    def direction_uv(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return ray directions (not unit length) in the camera frame of pixels (u, v)."""
        a = (u - self.K[0][2]) / self.K[0][0]
        b = (v - self.K[1][2]) / self.K[1][1]
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

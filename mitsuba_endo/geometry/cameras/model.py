"""A camera's intrinsics: pixel to ray and back."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from .registry import CAMERAS

_ROUND_TRIP_PX = 1e-3
"""Newton's method ends at rounding errors where it converges at all."""
_FOLD_STEPS = 16
"""Places at which the lens is looked at between the axis and a direction."""


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
        """Return NumPy unit directions (..., 3) of pixels (..., 2).

        NaN where the lens's coefficients fold the image back and no direction belongs to a pixel.
        """
        with np.errstate(all="ignore"):  # beyond a fold the inversion wanders off to infinity
            d = np.stack(self.direction_uv(pixels[..., 0], pixels[..., 1]), -1)
            d = d / np.linalg.norm(d, axis=-1, keepdims=True)
            return np.where(self._inverted(pixels, d)[..., None], d, np.nan)

    def _inverted(self, pixels: NDArray[np.float64], d: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell which unit directions (..., 3) belong to their pixels, with no fold on the way."""
        good: NDArray[np.bool_] = np.asarray(np.isfinite(d).all(-1))
        if not len(self.distortion) or not good.any():
            return good
        good = good & (np.abs(self.project(d) - pixels).max(-1) < _ROUND_TRIP_PX)
        widest = float(np.arccos(np.clip(d[good][..., 2], -1, 1)).max(initial=0.0))
        around = np.linspace(0, 2 * np.pi, 48, endpoint=False)
        rim = np.stack([np.sin(widest) * np.cos(around), np.sin(widest) * np.sin(around),
                        np.full_like(around, np.cos(widest))], -1)  # fmt: skip
        return good if self._unfolded_up_to(rim).all() else good & self._unfolded_up_to(d)

    def _unfolded_up_to(self, d: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell whether the lens does not fold between the axis and unit directions (..., 3)."""
        angle, around = np.arccos(np.clip(d[..., 2], -1, 1)), np.arctan2(d[..., 1], d[..., 0])
        unfolded = np.ones(angle.shape, bool)
        for part in np.linspace(0, 1, _FOLD_STEPS + 1)[1:]:
            radius = np.sin(part * angle)
            x, y, z = radius * np.cos(around), radius * np.sin(around), np.cos(part * angle)
            unfolded &= CAMERAS[self.model].density(self.distortion, x, y, z)[1]
        return unfolded

    def pixel_grid(self) -> NDArray[np.float64]:
        """Return the pixel centres (height, width, 2)."""
        x, y = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return np.stack([x, y], -1).astype(np.float64)

    @cached_property
    def grid_rays(self) -> NDArray[np.float64]:
        """Unit directions (height, width, 3) of all pixels, kept: inverting the lens takes long."""
        return self.rays(self.pixel_grid())

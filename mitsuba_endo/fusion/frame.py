"""What one camera saw of a surface: a range image with its pose."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.transforms import RigidTransform
from .depth_edges import mended, smooth_cells

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RangeFrame:
    """A range image with the camera that took it."""

    range: Floats
    """(H, W) distance along the camera's unit rays, NaN = not seen; any unit, the same for all."""
    camera: CameraModel
    world_from_camera: RigidTransform
    """In the unit of the ranges."""
    weight: Floats | None = None
    """(H, W) 1 / variance of each range, up to a factor that all frames share. None: as a
    triangulation has it, 1 / range^4."""

    def __post_init__(self) -> None:
        shape = (self.camera.height, self.camera.width)
        if self.range.shape != shape:
            raise ValueError(f"the range image is {self.range.shape}, the camera's {shape}")
        if self.weight is not None and self.weight.shape != shape:
            raise ValueError(f"the weight is {self.weight.shape}, the range image {shape}")

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) pixels that count: a range above zero and a weight above zero."""
        valid = np.isfinite(self.range) & (np.nan_to_num(self.range) > 0)
        if self.weight is not None:
            valid &= np.nan_to_num(self.weight) > 0
        return valid

    @cached_property
    def inverse_range(self) -> Floats:
        """(H, W) linear over a plane, up to the rays' bend between pixels; NaN = not seen.

        Single pixels that are missing or wild are interpolated where their neighbours agree.
        """
        return mended(1 / np.where(self.valid, self.range, np.nan), self.camera.grid_rays)

    @cached_property
    def spacing(self) -> Floats:
        """(H, W) angle between a pixel's ray and its neighbours', radians."""
        rays = self.camera.grid_rays
        across, down = (np.linalg.norm(np.gradient(rays, axis=a), axis=-1) for a in (1, 0))
        return np.sqrt(across * down)

    @property
    def footprint(self) -> float:
        """Median size of a pixel on a surface that faces the camera, the unit of the ranges."""
        return float(np.median((self.range * self.spacing)[self.valid]))

    @cached_property
    def cells(self) -> "Cells":
        return Cells.of(self)


@dataclass(frozen=True, eq=False)
class Cells:
    """The squares between four neighbouring pixels; the surface is interpolated within them."""

    smooth: NDArray[np.bool_]
    """(H - 1, W - 1) whether all four pixels belong to one sheet of the surface."""
    cosine: Floats
    """(H - 1, W - 1) of the angle between the ray and the surface's normal."""
    weight: Floats
    """(H - 1, W - 1) mean of the pixels'; what was not seen counts as zero."""
    cone: Floats
    """(H - 1, W - 1) cosine of an angle about the first pixel's ray that holds the cell."""

    @classmethod
    def of(cls, frame: RangeFrame) -> "Cells":
        inverse = frame.inverse_range
        smooth = smooth_cells(inverse, frame.camera.grid_rays)
        cosine = _cosines(frame.camera.grid_rays, 1 / inverse, smooth)
        cone = np.cos(3 * frame.spacing[:-1, :-1])
        weight = inverse**4 if frame.weight is None else frame.weight
        weight = _corner_mean(np.where(frame.valid, weight, 0.0))
        return cls(smooth, cosine, np.where(smooth, weight, 0.0), cone)


def _corner_mean(values: Floats) -> Floats:
    return (values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]) / 4


def _cosines(rays: Floats, ranges: Floats, smooth: NDArray[np.bool_]) -> Floats:
    """Return the cosines of incidence, from normals averaged over 3 x 3 smooth cells."""
    points = rays * ranges[..., None]
    normals = np.cross(points[1:, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, 1:])
    padded = np.pad(np.where(smooth[..., None], normals, 0.0), ((1, 1), (1, 1), (0, 0)))
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    normals = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]
    middle = _corner_mean(rays)
    length = np.linalg.norm(normals, axis=-1) * np.linalg.norm(middle, axis=-1)
    along = np.abs(np.sum(normals * middle, axis=-1))
    return along / np.where(length > 0, length, 1.0)

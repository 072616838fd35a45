"""What a view's geometry gives a training image: lattice coordinates, shading and depth edges."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from ..dataset.truth import MIXED, largest_step
from ..geometry.endoscope import Endoscope

if TYPE_CHECKING:
    from ..rendering.synthetic import MeshScene

SUPERSAMPLE = 2
"""Samples of the pattern per pixel along each axis."""
JUMP = 0.6
"""Periods per pixel that count as a depth edge."""
LEAST_FACING = 0.03
"""Cosine to which Lambert's law is followed: relief lights even a wall that is seen edge on."""
LATTICE_UNIT = 1e-3
"""Periods per unit of a stored coordinate: an eighth of the network's median error."""
UNLIT = -32768
"""Stored coordinate of a shadow: the least of 16 bits, its own negative."""
BIT_MIXED, BIT_EDGE, BIT_HIT = 1, 2, 4
"""Bits of a pixel's flags: no one truth, a depth edge, surface at all its samples."""


@dataclass(frozen=True, eq=False)
class View:
    """One view in the form in which it is stored."""

    lattice: NDArray[np.int16]
    """(2H, 2W, 2) coordinates from the pattern's middle in LATTICE_UNIT; UNLIT where in shadow."""
    shading: NDArray[np.float16]
    """(H, W, 4): irradiance from projector and lamp, cosine to the camera, cosine of the half
    vector between projector and camera; irradiances relative to their 99th percentile."""
    flags: NDArray[np.uint8]
    """(H, W) BIT_MIXED, BIT_EDGE, BIT_HIT."""


def make_view(scene: "MeshScene", endoscope: Endoscope) -> View:
    """Cast one view of a mesh.

    Args:
        scene: the mesh, in the world.
        endoscope: endoscope whose camera has SUPERSAMPLE samples per pixel.
    """
    view = scene.view(endoscope.camera, endoscope.world_from_camera, endoscope.projector,
                      endoscope.projector_from_camera)  # fmt: skip
    # Also in shadow: an edge is where the surface jumps, lit or not.
    everywhere = endoscope.projector.project(endoscope.projector_from_camera.apply(view.points))
    stored = np.round(view.q / LATTICE_UNIT)
    # NaN, in shadow, compares as false.
    inside = np.all(np.abs(stored) < -UNLIT, axis=-1, keepdims=True)
    lattice = np.where(inside, stored, UNLIT).astype(np.int16)
    return View(lattice, _shading(view.points, endoscope), _flags(view.points, everywhere))


def _flags(points: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.uint8]:
    hit = np.isfinite(points[..., 2])
    step = largest_step(q) * SUPERSAMPLE
    flags = np.zeros([n // SUPERSAMPLE for n in hit.shape], np.uint8)
    flags[_any(step > MIXED)] |= BIT_MIXED
    flags[_any(step > JUMP)] |= BIT_EDGE
    flags[~_any(~hit)] |= BIT_HIT
    return flags


def _any(samples: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which pixels (H, W) have such a sample."""
    height, width = samples.shape
    n = SUPERSAMPLE
    return np.logical_or.reduce(samples.reshape(height // n, n, width // n, n), axis=(1, 3))


def _shading(points: NDArray[np.float64], endoscope: Endoscope) -> NDArray[np.float16]:
    """Lambert's law and the inverse square of the distance, at pixels (H, W, 4)."""
    n = SUPERSAMPLE
    surface = np.ascontiguousarray(points[n // 2 :: n, n // 2 :: n])
    source = endoscope.projector_from_camera.inverse().t
    normal = _normals(surface)
    to_camera, distance = _unit(-surface)
    to_source, far = _unit(source - surface)
    half, _ = _unit(to_camera + to_source)
    facing = np.einsum("hwi,hwi->hw", normal, to_camera)
    lambert = np.clip(np.einsum("hwi,hwi->hw", normal, to_source), LEAST_FACING, 1)
    laser = _relative(lambert / far**2)
    lamp = _relative(np.clip(facing, LEAST_FACING, 1) / distance**2)
    mirror = np.einsum("hwi,hwi->hw", normal, half)
    stacked = np.stack([laser, lamp, np.clip(facing, 0, 1), np.clip(mirror, 0, 1)], -1)
    return np.nan_to_num(stacked).astype(np.float16)


def _normals(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return smoothed unit normals (H, W, 3) towards the camera from finite differences."""
    filled = np.nan_to_num(points)
    right = cv2.Sobel(filled, cv2.CV_64F, 1, 0)
    down = cv2.Sobel(filled, cv2.CV_64F, 0, 1)
    normal, _ = _unit(np.cross(down, right))
    # The mesh's flat triangles would show in the shading.
    smooth: NDArray[np.float64] = np.asarray(cv2.GaussianBlur(normal, (0, 0), 1.5), np.float64)
    normal, _ = _unit(smooth)
    return normal * -np.sign(np.einsum("hwi,hwi->hw", normal, filled))[..., None]


def _unit(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    length = np.maximum(np.linalg.norm(v, axis=-1), 1e-9)
    return v / length[..., None], length


def _relative(values: NDArray[np.float64]) -> NDArray[np.float64]:
    finite = values[np.isfinite(values)]
    top = np.percentile(finite, 99) if finite.size else 1.0
    return np.minimum(values / top, 3)

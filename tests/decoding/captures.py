"""Pictures of projected patterns, made without the package's renderer or decoder.

Each camera pixel integrates 2 x 2 rays. A ray looks up the projected image at its exact projector
coordinate, as rigs.py casts it; then follow albedo, ambient light, the lens's blur, noise that
grows with the signal, and rounding to 8 or 16 bits.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from mitsuba_endo.decoding.stack import Stack
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from tests.rigs import Rig, bumpy_sheet, cast, lopsided_camera

SIZE = (262, 207)
POSE = RigidTransform.of([0.05, -0.12, 0.03], [-6.2, 0.8, 0.9])
RAYS = 2


@dataclass(frozen=True, eq=False)
class View:
    """A rig at the camera's resolution and at that of the rays."""

    rig: Rig
    fine: Rig


def view() -> View:
    """A lopsided rig before a bumpy sheet; part of the image is not lit."""
    coarse = lopsided_camera(272, 190)
    K = coarse.K.copy()
    K[:2] *= RAYS
    K[:2, 2] += (
        RAYS - 1
    ) / 2  # pixel u is the middle of RAYS pixels around RAYS u + (RAYS - 1) / 2
    finer = CameraModel("opencv", RAYS * coarse.width, RAYS * coarse.height, K, coarse.distortion)
    projector = projector_model("pinhole", 255.0, (128.0, 105.0))
    surface = bumpy_sheet(70, (0.2, -0.1), 5, 3)
    return View(*(cast(c, projector, SIZE, POSE, surface) for c in (coarse, finer)))


def photograph(
    scene: View,
    patterns: Sequence[NDArray[np.uint8]],
    *,
    seed: int = 0,
    noise: float = 0.006,
    ambient: float = 0.08,
    gain: float = 0.75,
    blur: float = 0.6,
    bits: int = 8,
) -> Stack:
    """Return what the camera sees of each pattern; brightness is linear."""
    rng = np.random.default_rng(seed)
    q = scene.fine.q
    lit = np.isfinite(q[..., 0])
    at = np.where(lit[..., None], q, 0)[..., ::-1].transpose(2, 0, 1)
    height, width = scene.rig.q.shape[:2]
    albedo = 0.5 + 0.5 * gaussian_filter(rng.random((height, width)), 3, mode="wrap") * 1.0
    images = []
    for pattern in patterns:
        projected = gaussian_filter(pattern / 255.0, 0.3)
        light = np.where(lit, map_coordinates(projected, at, order=1, mode="nearest"), 0)
        light = light.reshape(height, RAYS, width, RAYS).mean((1, 3))
        image = gaussian_filter(albedo * (gain * light + ambient), blur)
        image += noise * np.sqrt(0.3 + image) * rng.standard_normal(image.shape)
        images.append(np.rint(np.clip(image, 0, 1) * (2**bits - 1)) / (2**bits - 1))
    stack = np.array(images, np.float32)
    return Stack(stack, stack >= 1, 2**bits - 1)


def inner(scene: View) -> NDArray[np.bool_]:
    """Pixels that are lit entirely, with their blur."""
    lit = np.isfinite(scene.rig.q[..., 0]).astype(float)
    return gaussian_filter(lit, 2) > 0.999

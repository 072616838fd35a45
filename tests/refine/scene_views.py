"""A bent surface before a calibrated pair, with exact coordinates and ranges; no renderer."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.refine.epipolar_sweep import KnownGeometry
from tests.refine.views import HEIGHT, WIDTH

POSE = RigidTransform.of(np.array([0.02, -0.08, 0.03]), np.array([-5.8, 1.2, 1.6]))
PROJECTOR = projector_model("direction_cosine", 300.0, (239.5, 191.5))


def geometry(fold: bool = False) -> KnownGeometry:
    """Return the pair with exact ranges, mm: a slanted, wavy wall, nearer from x = 130 on."""
    camera = CameraModel(
        "opencv", WIDTH, HEIGHT, np.array([[230, 0, 99.0], [0, 232, 76], [0, 0, 1]]), (-0.1, 0.01)
    )
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    depth = 42 + 0.04 * x - 0.03 * y + 0.8 * np.sin(x / 30) * np.cos(y / 25)
    if fold:
        depth = np.where(x >= 130, 0.7 * depth, depth)
    return KnownGeometry(camera, PROJECTOR, POSE, depth)


def coordinates_of(known: KnownGeometry) -> NDArray[np.float64]:
    """Return the exact coordinates (H, W, 2) that the pair sees."""
    points = known.camera.grid_rays * known.range[..., None]
    return known.projector.project(known.projector_from_camera.apply(points))


def turned(known: KnownGeometry, angle: float) -> KnownGeometry:
    """Return the pair with its projector rolled by an angle, radians: a wrong calibration."""
    roll = RigidTransform.of(np.array([0.0, 0.0, angle]), np.zeros(3))
    return replace(known, projector_from_camera=roll @ known.projector_from_camera)


def missing(known: KnownGeometry, where: NDArray[np.bool_]) -> KnownGeometry:
    """Return the geometry without ranges (H, W) there."""
    return replace(known, range=np.where(where, np.nan, known.range))

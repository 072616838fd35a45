"""How right a calibration from one map of a photograph is."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.solve.calibrate import calibrate

from .decoder_scenes import FOCAL, PATTERN, Kind, Shot, surface

GUESS = 1.1
"""The focal length's guess over the truth."""


@dataclass(frozen=True)
class Accuracy:
    """Errors of one calibration."""

    focal_percent: float
    """Of the focal length."""
    direction_deg: float
    """Of the projector's translation."""
    range_mm: float
    """Median over the pixels of the distance along rays."""


def calibrated(map_: CorrespondenceMap, kind: Kind, seed: int, shot: Shot) -> Accuracy:
    """Calibrate from one map, the baseline's length given, and compare with the truth."""
    rig = Rig(
        camera=Camera.from_model(shot.camera),
        projector=Projector(
            width=PATTERN.width, height=PATTERN.height, focal=Focal(value=GUESS * FOCAL)
        ),
        scale=Scale(baseline=float(np.linalg.norm(shot.projector_from_camera.t))),
    )
    found = calibrate([map_], rig)
    focal = found.solution.projector.focal.value
    pose = found.solution.frames[0].projector_from_camera
    t = np.asarray(np.ravel(pose.t), np.float64) if pose.t is not None else np.full(3, np.nan)
    vertices, faces = found.surface.vertices, found.surface.faces
    distance = range_image(RayCaster(np.asarray(vertices, float), np.asarray(faces)), shot.camera)
    error = np.abs(distance - _truth(kind, seed, shot))[map_.valid]
    return Accuracy(
        100 * abs(focal / FOCAL - 1) if isinstance(focal, float) else np.nan,
        float(np.degrees(angle_between(t, shot.projector_from_camera.t))),
        float(np.nanmedian(error)),
    )


@cache
def _truth(kind: Kind, seed: int, shot: Shot) -> NDArray[np.float64]:
    mesh = surface(kind, seed)
    vertices = shot.world_from_camera.inverse().apply(np.asarray(mesh.vertices, np.float64))
    return range_image(RayCaster(vertices, np.asarray(mesh.faces)), shot.camera)

"""Errors of one frame's calibration and points."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.transforms import angle_between, rotation_angle
from mitsuba_endo.rendering.synthetic import ExactView, MeshScene

from .capture import Truth
from .decoder_noise import Plain
from .peers import Found

Floats = NDArray[np.float64]


def exact_view(truth: Truth) -> ExactView:
    """Return what the first frame sees, without any error."""
    scene = MeshScene(truth.mesh.vertices, truth.mesh.faces)
    at, lit = truth.world_from_camera[0], truth.projector_from_camera[0]
    return scene.view(truth.camera, at, truth.projector, lit, truth.size)


def lit_points(truth: Truth) -> Floats:
    """Return the points (N, 3) of the first frame that have a correspondence."""
    view = exact_view(truth)
    return view.points[np.isfinite(view.q).all(-1)]


def calibration_errors(found: Found, truth: Truth) -> list[float]:
    """Return the errors of focal length (%), rotation and translation direction (degrees)."""
    pose = truth.projector_from_camera[0]
    return [
        100 * (found.focal / float(truth.projector.focal) - 1),
        float(np.degrees(rotation_angle(found.pose.R @ pose.R.T))),
        float(np.degrees(angle_between(found.pose.t, pose.t))),
    ]


def point_error(found: Found, truth: Truth, noise: Plain, seed: int) -> float:
    """Return the median distance of the points from the true surface, mm.

    Pixels with a gross error and pixels for which a method gives no point do not count.
    """
    rays = truth.camera.grid_rays
    gross = noise.gross((truth.camera.height, truth.camera.width), seed)
    kept = np.isfinite(found.ranges) & np.isfinite(exact_view(truth).q).all(-1) & ~gross
    kept &= np.abs(found.ranges) < 1e4  # points that ran off to infinity are no points
    if not kept.any():
        return float("nan")
    points = rays[kept] * found.ranges[kept, None]
    return float(np.median(distance_to_mesh(points, truth.mesh.vertices, truth.mesh.faces)))

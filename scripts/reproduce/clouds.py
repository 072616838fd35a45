"""Point clouds of calibrated and uncalibrated rigs, and the scale of each frame."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mitsuba_endo.evaluate.alignment import align_robustly
from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.given_pose import known_start
from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate

from .capture import Truth, read_inputs
from .pictures import COLOURS

Floats = NDArray[np.float64]


def triangulated(inputs: Path, error: RigidTransform, truth: Truth) -> Floats:
    """Return the points (N, 3) that the first map gives under a wrong calibration.

    Args:
        inputs: the capture, whose rig holds the wrong focal length.
        error: moves the true projector.
        truth: whose pose is spoilt.
    """
    maps, rig = read_inputs(inputs)
    camera = rig.camera.to_model()
    pose = error @ truth.projector_from_camera[0]
    start = known_start(maps[0].q, camera, rig.projector.to_model(), pose)
    depth = truth.baseline * start.depth[start.used]
    return camera.grid_rays[start.used] * depth[:, None]


def cloud_image(surface: SurfaceEstimate, camera: CameraModel) -> Floats:
    """Return the ranges (H, W) of a surface along the camera's rays, NaN = none."""
    return range_image(RayCaster(surface.vertices, surface.faces), camera)


def cloud(surface: SurfaceEstimate, truth: Truth) -> Floats:
    """Return the points (N, 3) of a surface on the first camera's rays."""
    found = cloud_image(surface, truth.camera)
    rays = truth.camera.grid_rays
    return (rays * found[..., None])[np.isfinite(found)]


def distances(points: Floats, truth: Truth) -> Floats:
    """Return the distances (N,) of points from the true surface, mm."""
    return distance_to_mesh(points, truth.mesh.vertices, truth.mesh.faces)


def frame_scale(found: Calibration, truth: Truth, frame: int) -> float:
    """Return by how much a surface, seen from one frame, is larger than the true one.

    The surface is that of a calibration of this frame alone or of all; NaN if it left this out.
    """
    names = [f.name for f in found.frames]
    if f"frame_{frame}.npz" not in names:
        return float("nan")
    at = names.index(f"frame_{frame}.npz")
    pose = found.solution.frames[at].world_from_camera.to_transform()
    assert pose is not None
    camera, true_pose = truth.camera, truth.world_from_camera[frame]
    rays = camera.grid_rays
    ours = RayCaster(pose.inverse().apply(found.surface.vertices), found.surface.faces)
    true = RayCaster(true_pose.inverse().apply(truth.mesh.vertices), truth.mesh.faces)
    a, b = range_image(ours, camera), range_image(true, camera)
    both = np.isfinite(a) & np.isfinite(b)
    fit = align_robustly(
        rays[both] * a[both, None], rays[both] * b[both, None], scale=True, rotation=True
    )
    return 1 / fit.scale


def clouds_picture(clouds: dict[str, Floats], truth: Truth) -> Figure:
    """Draw all clouds over the true one, from the camera and from above."""
    shown = {"truth": cloud(truth.surface, truth), **clouds}
    figure = Figure(figsize=(4 * len(shown), 7.2), layout="constrained")
    axes = figure.subplots(2, len(shown), sharex=True, sharey="row")
    for i, (name, points) in enumerate(shown.items()):
        for row, (across, towards) in enumerate(((1, 2), (2, 1))):
            axis = axes[row, i]
            for under, colour in ((shown["truth"], "0.8"), (points, COLOURS[i % 6])):
                order = np.argsort(-under[:, towards]) if row == 0 else np.arange(len(under))
                axis.plot(
                    *under[order][:, [0, across]].T,
                    ".",
                    color=colour,
                    markersize=1.2,
                    markeredgewidth=0,
                )
            axis.set_aspect("equal")
        axes[0, i].set_title(name)
        axes[1, i].set_xlabel("x (mm)")
    axes[0, 0].set_ylabel("y (mm)")
    axes[1, 0].set_ylabel("z (mm)")
    axes[0, 0].set_xlim(-40, 40)
    axes[0, 0].set_ylim(40, -40)
    axes[1, 0].set_ylim(30, 110)
    return figure

"""pycolmap's bundle adjustment of a camera and a projector, taken as a second camera."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.rig import Rig

Floats = NDArray[np.float64]
Model = Literal["SIMPLE_PINHOLE", "RADIAL_FISHEYE"]
"""Of COLMAP, for the projector."""
_EXTRA = {"SIMPLE_PINHOLE": (), "RADIAL_FISHEYE": (-1 / 6, 1 / 120)}
"""Held. sin a = a (1 - a^2 / 6 + a^4 / 120 - ...): the fisheye is the sine law, which is that of a
DOE, to 4e-5 at 45 degrees."""
_LAW = {"SIMPLE_PINHOLE": "pinhole", "RADIAL_FISHEYE": "direction_cosine"}
_MAX_ITERATIONS = 200


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What the bundle adjustment found, scaled to the known baseline."""

    seconds: float
    """Of the adjustment itself; building the reconstruction is not counted."""
    focal: float
    """Pattern pixels."""
    pose: RigidTransform
    """projector_from_camera, mm."""
    points: Floats
    """(N, 3) in the camera's frame, mm, in the order of the map's valid pixels."""


def adjust(q: Floats, camera: CameraModel, rig: Rig, plane: float, model: Model) -> Adjusted:
    """Adjust projector pose, focal length and points under a Cauchy loss.

    The start is the published one: the rig's focal length and a projector that looks like the
    camera from a baseline to its right; points are triangulated from it, and put on a plane where
    that gives nothing sensible.

    Args:
        q: (H, W, 2) map, pattern pixels, NaN = missing.
        camera: without distortion.
        rig: with the starting focal length and the baseline.
        plane: distance of the plane, mm.
        model: of the projector.
    """
    colmap = _colmap()
    assert rig.scale.baseline is not None
    assert rig.projector.focal.value is not None
    valid, baseline = np.isfinite(q).all(-1), rig.scale.baseline
    seen, rays = q[valid].astype(np.float64), camera.grid_rays[valid]
    t = np.array([-baseline, 0.0, 0.0])
    start = projector_model(_LAW[model], rig.projector.focal.value, _centre(rig))
    problem = _reconstruction(camera, rig, model, seen, camera.pixel_grid()[valid], t)
    for i, point in enumerate(_triangulated(rays, start.unproject(seen), t, plane)):
        track = colmap.Track()
        track.add_element(1, i)
        track.add_element(2, i)
        problem.add_point3D(point, track)
    adjuster = _adjuster(problem)
    began = perf_counter()
    adjuster.solve()
    return _result(perf_counter() - began, problem, len(seen), baseline)


def _reconstruction(
    camera: CameraModel, rig: Rig, model: Model, q: Floats, pixels: Floats, t: Floats
) -> Any:
    colmap, K = _colmap(), camera.K
    projector = [rig.projector.focal.value, *_centre(rig), *_EXTRA[model]]
    size = (rig.projector.width, rig.projector.height)
    out = colmap.Reconstruction()
    for number, name, (width, height), parameters in (
        (1, "SIMPLE_PINHOLE", (camera.width, camera.height), [K[0, 0], K[0, 2], K[1, 2]]),
        (2, model, size, projector),
    ):
        out.add_camera_with_trivial_rig(
            colmap.Camera(
                camera_id=number, model=name, width=width, height=height, params=parameters
            )
        )
    poses = (colmap.Rigid3d(), colmap.Rigid3d(colmap.Rotation3d(), t))
    for number, seen, pose in ((1, pixels, poses[0]), (2, q, poses[1])):
        points = colmap.Point2DList([colmap.Point2D(p) for p in seen])
        image = colmap.Image(image_id=number, name=str(number), camera_id=number, points2D=points)
        out.add_image_with_trivial_frame(image, pose)
    return out


def _triangulated(rays: Floats, bearings: Floats, t: Floats, plane: float) -> Floats:
    """Return the points (N, 3) on the camera rays nearest to the projector's rays under R = I."""
    along = np.einsum("ni,ni->n", rays, bearings)
    distance = (bearings @ t * along - rays @ t) / (1 - along**2)
    flat = plane / rays[:, 2]
    sensible = (distance > flat / 7) & (distance < 7 * flat)
    return rays * np.where(sensible, distance, flat)[:, None]


def _adjuster(problem: Any) -> Any:
    colmap = _colmap()
    config = colmap.BundleAdjustmentConfig()
    config.add_image(1)
    config.add_image(2)
    config.set_constant_cam_intrinsics(1)
    config.fix_gauge(colmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = colmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = True
    options.refine_principal_point = options.refine_extra_params = False
    options.ceres.solver_options.max_num_iterations = _MAX_ITERATIONS
    options.ceres.loss_function_type = colmap.LossFunctionType.CAUCHY
    return colmap.create_default_bundle_adjuster(options, config, problem)


def _result(seconds: float, problem: Any, count: int, baseline: float) -> Adjusted:
    camera, projector = (problem.images[i].cam_from_world() for i in (1, 2))
    moved = projector * camera.inverse()
    scale = baseline / float(np.linalg.norm(moved.translation))
    world = np.array([problem.points3D[i + 1].xyz for i in range(count)])
    points = world @ camera.rotation.matrix().T + camera.translation
    pose = RigidTransform.of(moved.rotation.matrix(), scale * moved.translation)
    return Adjusted(seconds, float(problem.cameras[2].params[0]), pose, scale * points)


def _centre(rig: Rig) -> list[float]:
    return rig.projector.centre or rig.projector.middle


def _colmap() -> Any:
    """Without static types: its stubs lack the options of Ceres."""
    import pycolmap  # pyright: ignore[reportMissingImports]

    colmap: Any = pycolmap
    colmap.logging.minloglevel = 2  # errors: a wrong model makes Ceres warn at every step
    return colmap

"""The peer: pycolmap's bundle adjustment of a camera and a projector, taken as a second camera."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pycolmap  # pyright: ignore[reportMissingImports]  the benchmark extra
from numpy.typing import NDArray

from .report import timed
from .scene import CENTRE, PATTERN, PLANE_MM, WRONG_FOCAL, Scene

colmap: Any = pycolmap
"""Without static types: its stubs lack the options of Ceres."""
_MAX_ITERATIONS = 200


@dataclass(frozen=True, eq=False)
class Adjusted:
    """What the bundle adjustment found, scaled to the known baseline."""

    seconds: float
    """Of the adjustment itself; building the reconstruction is not counted."""
    focal: float
    points: NDArray[np.float64]
    """(N, 3) in the camera's frame, mm, in the order of the map's valid pixels."""


def adjust(scene: Scene) -> Adjusted:
    """Adjust projector pose, focal length and points under a Cauchy loss.

    The start is the one that our solvers get: focal length 10 % off, a projector that looks like
    the camera from a baseline to its right; points triangulated from it.
    """
    valid = scene.map.valid
    q = scene.map.q[valid].astype(np.float64)
    rays = scene.camera.rays(scene.camera.pixel_grid())[valid]
    t = np.array([-scene.baseline, 0.0, 0.0])
    reconstruction = _reconstruction(scene, q, valid, t)
    for i, point in enumerate(_triangulated(rays, q, t)):
        track = colmap.Track()
        track.add_element(1, i)
        track.add_element(2, i)
        reconstruction.add_point3D(point, track)
    seconds, _ = timed(_adjuster(reconstruction).solve)
    return _result(seconds, reconstruction, len(q), scene.baseline)


def _reconstruction(
    scene: Scene, q: NDArray[np.float64], valid: NDArray[np.bool_], t: NDArray[np.float64]
) -> Any:
    K, camera = scene.camera.K, scene.camera
    pixels = camera.pixel_grid()[valid]
    out = colmap.Reconstruction()
    for number, size, parameters in (
        (1, (camera.width, camera.height), [K[0, 0], K[0, 2], K[1, 2]]),
        (2, PATTERN, [WRONG_FOCAL, *CENTRE]),
    ):
        out.add_camera_with_trivial_rig(
            colmap.Camera(
                camera_id=number,
                model="SIMPLE_PINHOLE",
                width=size[0],
                height=size[1],
                params=parameters,
            )
        )
    poses = (colmap.Rigid3d(), colmap.Rigid3d(colmap.Rotation3d(), t))
    for number, seen, pose in ((1, pixels, poses[0]), (2, q, poses[1])):
        points = colmap.Point2DList([colmap.Point2D(p) for p in seen])
        image = colmap.Image(image_id=number, name=str(number), camera_id=number, points2D=points)
        out.add_image_with_trivial_frame(image, pose)
    return out


def _triangulated(
    rays: NDArray[np.float64], q: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the points (N, 3) on the camera rays nearest to the projector's rays under R = I."""
    b = np.column_stack([(q - CENTRE) / WRONG_FOCAL, np.ones(len(q))])
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    along = np.einsum("ni,ni->n", rays, b)
    distance = (b @ t * along - rays @ t) / (1 - along**2)
    plane = PLANE_MM / rays[:, 2]
    sensible = (distance > plane / 7) & (distance < 7 * plane)
    return rays * np.where(sensible, distance, plane)[:, None]


def _adjuster(reconstruction: Any) -> Any:
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
    return colmap.create_default_bundle_adjuster(options, config, reconstruction)


def _result(seconds: float, reconstruction: Any, count: int, baseline: float) -> Adjusted:
    camera, projector = (reconstruction.images[i].cam_from_world() for i in (1, 2))
    scale = baseline / np.linalg.norm((projector * camera.inverse()).translation)
    world = np.array([reconstruction.points3D[i + 1].xyz for i in range(count)])
    points = world @ camera.rotation.matrix().T + camera.translation
    return Adjusted(seconds, float(reconstruction.cameras[2].params[0]), scale * points)

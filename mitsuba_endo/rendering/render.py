"""Rendering a capture: the camera's image with everything that is known about it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.transforms import RigidTransform
from ..records.ground_truth import GroundTruth
from . import keys
from .scene import LoadedScene
from .traced_image import traced_image
from .truth import truth_of


@dataclass(frozen=True, eq=False)
class Capture:
    """A synthetic capture. Images are (H, W[, channels]); missing values are NaN."""

    image: NDArray[np.float32]
    """(H, W, 3) linear RGB radiance."""
    projector: NDArray[np.float32]
    """(H, W, 2) pattern coordinates, also in the projector's shadow and outside its pattern."""
    depth: NDArray[np.float32]
    """(H, W) z in the camera's frame, mm."""
    normals: NDArray[np.float32]
    """(H, W, 3) unit normals in the camera's frame (OpenCV axes), towards the camera."""
    visible: NDArray[np.bool_]
    """(H, W) lit by the projector."""
    camera_mask: NDArray[np.bool_]
    """(H, W) the camera sees a surface."""
    truth: GroundTruth
    """Exact calibration."""

    def correspondences(self) -> NDArray[np.float32]:
        """Return the exact map (H, W, 2): pattern coordinates where lit, else NaN."""
        return np.where(self.visible[..., None], self.projector, np.float32(np.nan))


def render_capture(loaded: LoadedScene, spp: int = 64, seed: int = 0, name: str = "map") -> Capture:
    """Render the scene's image with its own integrator, and its exact geometry.

    Args:
        loaded: the scene.
        spp: samples per pixel of the image; geometry is exact and needs none.
        seed: seed of the image's noise.
        name: name of the frame in the truth.

    Raises:
        InputError: a scalar variant of Mitsuba is active.
    """
    from .. import backend

    backend.ensure_vectorised()
    image = traced_image(loaded.scene, sensor=loaded.sensor(), spp=spp, seed=seed)
    coordinates = projector_coordinates(loaded)
    return Capture(
        image=np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image[..., :3],
        projector=coordinates[..., :2],
        depth=coordinates[..., 2],
        normals=camera_normals(loaded),
        visible=coordinates[..., 3] > 0,
        camera_mask=coordinates[..., 4] > 0,
        truth=truth_of(loaded, name),
    )


def projector_coordinates(loaded: LoadedScene) -> NDArray[np.float32]:
    """Return the (H, W, 5) channels of the integrator ``projector_coords``."""
    from .mitsuba_modules import mi

    settings = {"type": "projector_coords", "projector": keys.PROJECTOR}
    integrator: Any = mi.load_dict(settings)
    return traced_image(loaded.scene, sensor=loaded.sensor(), integrator=integrator)


def camera_normals(loaded: LoadedScene) -> NDArray[np.float32]:
    """Return (H, W, 3) shading normals in the camera's frame, towards the camera; NaN = none."""
    from .mitsuba_modules import dr
    from .rays import pixel_rays

    ray, width, height = pixel_rays(loaded.sensor())
    si = loaded.scene.ray_intersect(ray)
    facing = dr.select(dr.dot(si.sh_frame.n, ray.d) > 0, -1.0, 1.0)
    world = (si.sh_frame.n * facing).numpy().T
    camera_from_world: RigidTransform = loaded.world_from_camera().inverse()
    normals = camera_from_world.rotate(world.astype(np.float64))
    normals[~si.is_valid().numpy()] = np.nan
    return normals.reshape(height, width, 3).astype(np.float32)

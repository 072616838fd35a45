"""A simulated photograph: path tracing of tissue under the projector, then camera effects."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .. import backend
from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..shapes.mesh import Mesh
from .checks import check_mesh, check_pattern
from .effects import apply_effects
from .effects.encoding import Encoded
from .settings import CaptureSettings

if TYPE_CHECKING:
    from .photograph_scene import PhotographScene


@dataclass(frozen=True, eq=False)
class Photograph:
    """What the camera delivers, and the light that made it."""

    image: Encoded
    """(h, w, 3), or (h, w) if gray; uint8 or uint16, encoded as ``settings.effects`` says."""
    radiance: NDArray[np.float32]
    """(h, w, 3) linear RGB before any effect."""
    laser: NDArray[np.float32]
    """(h, w, 3) the laser's part of it; the rest is the lamp's."""


def photograph(
    mesh: Mesh,
    camera: CameraModel,
    world_from_camera: RigidTransform,
    projector: ProjectorModel,
    projector_from_camera: RigidTransform,
    pattern: NDArray[np.float32],
    settings: CaptureSettings,
    seed: int,
    *,
    pattern_size: tuple[int, int] | None = None,
) -> Photograph:
    """Photograph a mesh of wet tissue under the projector's pattern and the endoscope's lamp.

    The same arguments give the same photograph. Mitsuba is started if no variant is active.

    Args:
        mesh: in the world, mm; faces counter-clockwise seen from the side the camera is on.
        camera: intrinsics, with the lens distortion that the image will have.
        world_from_camera: its pose, OpenCV axes.
        projector: intrinsics, pattern pixels.
        projector_from_camera: its pose relative to the camera.
        pattern: (H, W, 3) linear RGB; only ratios matter, ``settings.light`` gives the power.
        settings: tissue, light, camera effects, samples.
        seed: of the path tracer's and of the effects' noise.
        pattern_size: width and height in pattern pixels. Default: those of ``pattern``.

    Raises:
        InputError: a mesh in other units or wound at random, no pattern, or a camera that sees
            nothing or stands inside the wall (see :mod:`.checks`).
    """
    scene = load_scene(mesh, camera, projector, pattern, settings, pattern_size)
    scene.set_poses(world_from_camera, projector_from_camera)
    return take_photograph(scene, camera, settings, seed)


def load_scene(
    mesh: Mesh,
    camera: CameraModel,
    projector: ProjectorModel,
    pattern: NDArray[np.float32],
    settings: CaptureSettings,
    pattern_size: tuple[int, int] | None = None,
) -> "PhotographScene":
    """Return the scene of a photograph whose poses are still to be set; arguments as above.

    Raises:
        InputError: a mesh in other units or wound at random, or no pattern.
    """
    check_mesh(mesh)
    check_pattern(pattern)
    backend.ensure()
    from .photograph_scene import PhotographScene, SceneParts

    size = pattern_size or (pattern.shape[1], pattern.shape[0])
    return PhotographScene(SceneParts(mesh, camera, projector, pattern, size), settings)


def take_photograph(
    scene: "PhotographScene", camera: CameraModel, settings: CaptureSettings, seed: int
) -> Photograph:
    """Return the photograph of a scene from the poses that it was set to."""
    laser, lamp = scene.trace(seed)
    radiance = laser + lamp
    image = apply_effects(
        radiance, settings.effects, seed, laser=laser, cosine=cosine_to_axis(camera)
    )
    return Photograph(image, radiance, laser)


def cosine_to_axis(camera: CameraModel) -> NDArray[np.float64]:
    """Return the (h, w) cosine of the angle between each pixel's ray and the optical axis."""
    return np.nan_to_num(camera.grid_rays[..., 2])

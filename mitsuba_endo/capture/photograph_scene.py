"""The Mitsuba scene of a photograph: mesh, tissue, camera, projector and lamp."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CAMERAS, CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..interrupts import uninterrupted
from ..rendering import keys
from ..rendering.axes import to_world_from_pose
from ..rendering.mitsuba_modules import mi
from ..rendering.synthetic import Hits, MeshScene
from ..rendering.traced_image import traced_image
from ..shapes.mesh import Mesh
from .checks import check_view
from .creases import with_creases
from .materials import (
    entering_part,
    index_of_refraction,
    opaque_tissue,
    reflected_part,
    translucent_tissue,
)
from .settings import CaptureSettings, Light
from .subsurface_blur import subsurface_blur

LAMP_SAMPLES = 4
"""The lamp's light has no fine lines: it gets so many times fewer samples than the laser's."""
_LONGEST_WALK = 256
"""Scatterings inside the tissue; at an albedo of 0.99 8 % of the light lives longer."""


@dataclass(frozen=True, eq=False)
class SceneParts:
    """What a photograph's scene holds, whatever the poses."""

    mesh: Mesh
    """In the world, mm."""
    camera: CameraModel
    projector: ProjectorModel
    pattern: NDArray[np.float32]
    """(H, W, 3) linear RGB."""
    pattern_size: tuple[int, int]
    """Width and height, pattern pixels."""


@dataclass(frozen=True, eq=False)
class _View:
    """What the camera sees from where it stands."""

    hits: Hits
    points: NDArray[np.float32]
    """(h, w, 3) surface points of the pixels, mm; NaN where there is none."""
    pixels_per_mm: NDArray[np.float32]
    """(h, w) on a surface across the ray."""


class PhotographScene:
    """One scene, loaded once: to look for poses in it, and to be rendered light by light."""

    def __init__(self, parts: SceneParts, settings: CaptureSettings) -> None:
        """Load the scene; camera and projector stand at the origin until :meth:`set_poses`."""
        self._tissue, self._parts, self._settings = settings.tissue, parts, settings
        medium = None
        bsdf = opaque_tissue(self._tissue)
        walk = {"type": "path", "max_depth": settings.max_depth}
        if self._tissue.subsurface == "medium":
            bsdf, medium = translucent_tissue(self._tissue)
            walk = {"type": "volpath", "max_depth": _LONGEST_WALK}
        self._integrator: Any = mi.load_dict(walk)
        self._direct: Any = mi.load_dict({"type": "path", "max_depth": 2})
        described = {
            "type": "scene", keys.CAMERA: _sensor(parts),
            keys.SURFACE: _surface(parts.mesh, bsdf, medium), **_lights(parts, settings.light),
        }  # fmt: skip
        with uninterrupted():  # of one Mitsuba makes an error of the plugin
            self._scene: Any = mi.load_dict(described)
        self._parameters = mi.traverse(self._scene)
        self._view: _View | None = None
        self.surface = MeshScene(parts.mesh.vertices, parts.mesh.faces, self._scene)
        """The mesh, to follow rays."""

    def set_poses(
        self, world_from_camera: RigidTransform, projector_from_camera: RigidTransform
    ) -> Hits:
        """Set the poses of camera, projector and lamp (OpenCV axes).

        Returns:
            Where the rays through the pixels' centres, row by row, meet the mesh.

        Raises:
            InputError: the camera sees nothing or stands inside the wall.
        """
        world_from_projector = world_from_camera @ projector_from_camera.inverse()
        values = {
            keys.to_world(keys.CAMERA): _pose(world_from_camera),
            keys.to_world(keys.PROJECTOR): _pose(world_from_projector),
        }
        light = self._settings.light
        if light.lamp:
            ends = world_from_camera.apply(_lamp_ends(light.lamp_offset))
            values |= {
                keys.position(_lamp(i)): mi.Point3f(*end.tolist()) for i, end in enumerate(ends)
            }
        self._set(values)
        self._view = self._look(world_from_camera)
        return self._view.hits

    def trace(self, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the radiance (h, w, 3) by the laser and by the lamp, each from a pass of its own.

        A pass for each light, because speckle belongs to the laser, and because the path tracer
        chooses one light at random at every reflection, which would turn two into noise.
        """
        spp = self._settings.spp
        laser = self._by(keys.PROJECTOR, spp, 2 * seed)
        if not self._settings.light.lamp:
            return laser, np.zeros_like(laser)
        return laser, self._by(keys.LAMP, max(1, spp // LAMP_SAMPLES), 2 * seed + 1)

    def _by(self, light: str, spp: int, seed: int) -> NDArray[np.float32]:
        """Return the radiance (h, w, 3) by the light whose ids begin with ``light``."""
        for emitter in self._scene.emitters():
            chosen = float(emitter.id().startswith(light))
            self._parameters[keys.sampling_weight(emitter.id())] = chosen
        if self._tissue.subsurface != "blur":
            self._parameters.update()
            return self._image(self._integrator, spp, seed)
        self._set(entering_part(self._tissue))
        entered = self._spread(self._image(self._integrator, spp, seed))
        self._set(reflected_part(self._tissue))
        return entered + self._image(self._direct, spp, seed)

    def _set(self, values: dict[str, Any]) -> None:
        for key, value in values.items():  # update(values) would pass over unknown keys
            self._parameters[key] = value
        self._parameters.update()

    def _image(self, integrator: Any, spp: int, seed: int) -> NDArray[np.float32]:
        image = traced_image(self._scene, integrator=integrator, spp=spp, seed=seed)
        return image[..., :3]

    def _spread(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        tissue, view = self._tissue, self._view
        assert view is not None, "set_poses() comes first"
        return subsurface_blur(
            image, view.points, view.pixels_per_mm, tissue.mean_free_path, tissue.base_color,
            index_of_refraction(tissue.specular),
        )  # fmt: skip

    def _look(self, world_from_camera: RigidTransform) -> _View:
        camera = self._parts.camera
        hits = self.surface.through_pixels(camera, world_from_camera)
        hit = hits.hit
        check_view(float(hit.mean()), hits.from_behind(world_from_camera.t))
        rays = hits.points - world_from_camera.t
        distance = np.where(hit, np.sqrt(np.einsum("ni,ni->n", rays, rays)), np.nan)
        shape = camera.height, camera.width
        return _View(
            hits,
            np.where(hit[:, None], hits.points, np.nan).astype(np.float32).reshape(*shape, 3),
            (camera.K[0, 0] / distance).astype(np.float32).reshape(shape),
        )


def mean_intensity(parts: SceneParts) -> float:
    """Return the share of the power per steradian, on the axis, that a uniform pattern has."""
    on_axis = parts.projector.density_xyz(np.zeros(1), np.zeros(1), np.ones(1))
    return float(on_axis[0]) / (parts.pattern_size[0] * parts.pattern_size[1])


def _lights(parts: SceneParts, light: Light) -> dict[str, Any]:
    lights = {keys.PROJECTOR: _projector(parts, light.projector_power)}
    if light.lamp:
        intensity = light.lamp * light.projector_power * mean_intensity(parts)
        lights |= _lamps(light.lamp_offset, intensity * np.array(light.lamp_color))
    return lights


def _pose(world_from_object: RigidTransform) -> Any:
    matrix = to_world_from_pose(world_from_object).tolist()
    return mi.AffineTransform4f(mi.ScalarAffineTransform4f(matrix))


def _sensor(parts: SceneParts) -> dict[str, Any]:
    camera, K = parts.camera, parts.camera.K
    film = {"type": "hdrfilm", "width": camera.width, "height": camera.height,
            "rfilter": {"type": "box"}, "pixel_format": "rgb"}  # fmt: skip
    names = CAMERAS[camera.model].coefficients
    lens = dict(zip(names, (float(k) for k in camera.distortion), strict=False))
    return {
        "type": "endoscope", "model": camera.model,
        "fx": float(K[0, 0]), "fy": float(K[1, 1]), "cx": float(K[0, 2]), "cy": float(K[1, 2]),
        "film": film, **lens,
    }  # fmt: skip


def _projector(parts: SceneParts, power: float) -> dict[str, Any]:
    projector = parts.projector
    image = np.ascontiguousarray(parts.pattern, np.float32)
    width, height = parts.pattern_size
    coefficients = (float(k) for k in projector.distortion.coefficients)
    return {
        "type": "doe_projector", "law": projector.law,
        "width": width, "height": height, "focal": float(projector.focal),
        "centre_x": float(projector.centre[0]), "centre_y": float(projector.centre[1]),
        "aspect": float(projector.aspect), "power": power,
        "pattern": {"type": "bitmap", "bitmap": mi.Bitmap(image), "raw": True,
                    "wrap_mode": "clamp"},
        **dict(zip(keys.DISTORTION, coefficients, strict=False)),
    }  # fmt: skip


def _lamps(offset: float, intensity: NDArray[np.float64]) -> dict[str, Any]:
    """Return two light guides beside the lens that share the intensity (3,)."""
    return {
        _lamp(i): {
            "type": "point", "position": end.tolist(),
            "intensity": {"type": "rgb", "value": (intensity / 2).tolist()},
        }
        for i, end in enumerate(_lamp_ends(offset))
    }  # fmt: skip


def _lamp(number: int) -> str:
    return f"{keys.LAMP}_{number}"


def _lamp_ends(offset: float) -> NDArray[np.float64]:
    """Return where the light guides end (2, 3), mm in the camera's frame."""
    return np.array([[-offset, 0.0, 0.0], [offset, 0.0, 0.0]])


def _surface(mesh: Mesh, bsdf: dict[str, Any], medium: dict[str, Any] | None) -> Any:
    props = mi.Properties()
    props["material"] = mi.load_dict(bsdf)
    if medium is not None:
        props["interior"] = mi.load_dict(medium)
    vertices, faces = with_creases(mesh)
    surface: Any = mi.Mesh(
        keys.SURFACE, len(vertices), len(faces), props=props, has_vertex_normals=True
    )
    parameters = mi.traverse(surface)
    parameters[keys.FACES] = faces.astype(np.uint32).ravel()
    parameters[keys.VERTEX_POSITIONS] = vertices.astype(np.float32).ravel()
    parameters.update()
    return surface

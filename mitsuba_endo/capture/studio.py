"""The Mitsuba scene of a photograph: mesh, tissue, camera, projector and lamp."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.laws import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..rendering import keys
from ..rendering.axes import to_world_from_pose
from ..rendering.rays import pixel_rays
from ..rendering.untyped import dr, mi
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
class SetUp:
    """Geometry of one photograph; poses have OpenCV axes."""

    mesh: Mesh
    """In the world, mm."""
    camera: CameraModel
    world_from_camera: RigidTransform
    projector: ProjectorModel
    projector_from_camera: RigidTransform
    pattern: NDArray[np.float32]
    """(H, W, 3) linear RGB."""
    pattern_size: tuple[int, int]
    """Width and height, pattern pixels."""


def trace(
    setup: SetUp, settings: CaptureSettings, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the radiance (h, w, 3) by the laser and by the lamp, each from a pass of its own.

    A pass for each light, because speckle belongs to the laser, and because the path tracer
    chooses one light at random at every reflection, which would turn two into noise.
    """
    studio = Studio(setup, settings)
    laser = studio.by(keys.PROJECTOR, settings.spp, 2 * seed)
    if not settings.light.lamp:
        return laser, np.zeros_like(laser)
    spp = max(1, settings.spp // LAMP_SAMPLES)
    return laser, studio.by(keys.LAMP, spp, 2 * seed + 1)


class Studio:
    """One loaded scene, rendered light by light."""

    def __init__(self, setup: SetUp, settings: CaptureSettings) -> None:
        self._tissue, self._setup = settings.tissue, setup
        medium = None
        bsdf = opaque_tissue(self._tissue)
        walk = {"type": "path", "max_depth": settings.max_depth}
        if self._tissue.subsurface == "medium":
            bsdf, medium = translucent_tissue(self._tissue)
            walk = {"type": "volpath", "max_depth": _LONGEST_WALK}
        self._integrator: Any = mi.load_dict(walk)
        self._scene: Any = mi.load_dict({
            "type": "scene", keys.CAMERA: _sensor(setup),
            keys.SURFACE: _surface(setup.mesh, bsdf, medium), **_lights(setup, settings.light),
        })  # fmt: skip
        self._parameters = mi.traverse(self._scene)
        self._look()

    def by(self, light: str, spp: int, seed: int) -> NDArray[np.float32]:
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
        direct: Any = mi.load_dict({"type": "path", "max_depth": 2})
        return entered + self._image(direct, spp, seed)

    def _set(self, values: dict[str, Any]) -> None:
        for key, value in values.items():  # update(values) would pass over unknown keys
            self._parameters[key] = value
        self._parameters.update()

    def _image(self, integrator: Any, spp: int, seed: int) -> NDArray[np.float32]:
        image = mi.render(self._scene, integrator=integrator, spp=spp, seed=seed)
        return np.array(image, np.float32)[..., :3]

    def _spread(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        tissue = self._tissue
        return subsurface_blur(
            image, self._points, self._pixels_per_mm, tissue.mean_free_path, tissue.base_color,
            index_of_refraction(tissue.specular),
        )  # fmt: skip

    def _look(self) -> None:
        """Find the points that pixels see (h, w, 3), mm, NaN = none, and pixels per mm (h, w)."""
        ray, width, height = pixel_rays(self._scene.sensors()[0])
        found = self._scene.ray_intersect(ray)
        hit = found.is_valid()
        distance = dr.select(hit, found.t, dr.nan)
        self._points = np.array(ray(distance), np.float32).T.reshape(height, width, 3)
        along = np.array(distance, np.float32).reshape(height, width)
        self._pixels_per_mm = np.float32(self._setup.camera.K[0, 0]) / along
        seen = hit.numpy()
        away = (dr.dot(found.n, ray.d) > 0).numpy()
        check_view(float(seen.mean()), float(away[seen].mean()) if seen.any() else 0.0)


def mean_intensity(setup: SetUp) -> float:
    """Return the share of the power per steradian, on the axis, that a uniform pattern has."""
    on_axis = setup.projector.density_xyz(np.zeros(1), np.zeros(1), np.ones(1))
    return float(on_axis[0]) / (setup.pattern_size[0] * setup.pattern_size[1])


def _lights(setup: SetUp, light: Light) -> dict[str, Any]:
    lights = {keys.PROJECTOR: _projector(setup, light.projector_power)}
    if light.lamp:
        intensity = light.lamp * light.projector_power * mean_intensity(setup)
        lights |= _lamps(setup, light.lamp_offset, intensity * np.array(light.lamp_color))
    return lights


def _pose(world_from_object: RigidTransform) -> Any:
    return mi.ScalarTransform4f(to_world_from_pose(world_from_object).tolist())


def _sensor(setup: SetUp) -> dict[str, Any]:
    camera, K = setup.camera, setup.camera.K
    film = {"type": "hdrfilm", "width": camera.width, "height": camera.height,
            "rfilter": {"type": "box"}, "pixel_format": "rgb"}  # fmt: skip
    lens = dict(zip(keys.LENSES[camera.model], (float(k) for k in camera.distortion), strict=False))
    return {
        "type": "endoscope", "model": camera.model, "to_world": _pose(setup.world_from_camera),
        "fx": float(K[0, 0]), "fy": float(K[1, 1]), "cx": float(K[0, 2]), "cy": float(K[1, 2]),
        "film": film, **lens,
    }  # fmt: skip


def _projector(setup: SetUp, power: float) -> dict[str, Any]:
    projector = setup.projector
    image = np.ascontiguousarray(setup.pattern, np.float32)
    width, height = setup.pattern_size
    world_from_projector = setup.world_from_camera @ setup.projector_from_camera.inverse()
    coefficients = (float(k) for k in projector.distortion.coefficients)
    return {
        "type": "doe_projector", "law": projector.law, "to_world": _pose(world_from_projector),
        "width": width, "height": height, "focal": float(projector.focal),
        "centre_x": float(projector.centre[0]), "centre_y": float(projector.centre[1]),
        "aspect": float(projector.aspect), "power": power,
        "pattern": {"type": "bitmap", "bitmap": mi.Bitmap(image), "raw": True,
                    "wrap_mode": "clamp"},
        **dict(zip(keys.DISTORTION, coefficients, strict=False)),
    }  # fmt: skip


def _lamps(setup: SetUp, offset: float, intensity: NDArray[np.float64]) -> dict[str, Any]:
    """Return two light guides beside the lens that share the intensity (3,)."""
    ends = setup.world_from_camera.apply(np.array([[-offset, 0.0, 0.0], [offset, 0.0, 0.0]]))
    return {
        f"{keys.LAMP}_{i}": {
            "type": "point", "position": end.tolist(),
            "intensity": {"type": "rgb", "value": (intensity / 2).tolist()},
        }
        for i, end in enumerate(ends)
    }  # fmt: skip


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

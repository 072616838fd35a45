"""The Mitsuba scenes of a photograph: mesh, tissue, camera, projector and lamp."""

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
from .materials import dry_tissue, index_of_refraction, translucent_tissue, wet_surface, wet_tissue
from .settings import CaptureSettings
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
    light = settings.light
    laser = {keys.PROJECTOR: _projector(setup, light.projector_power)}
    by_laser = _render(setup, settings, laser, settings.spp, 2 * seed)
    if not light.lamp:
        return by_laser, np.zeros_like(by_laser)
    intensity = light.lamp * light.projector_power * mean_intensity(setup)
    lamps = _lamps(setup, light.lamp_offset, intensity * np.array(light.lamp_color))
    spp = max(1, settings.spp // LAMP_SAMPLES)
    return by_laser, _render(setup, settings, lamps, spp, 2 * seed + 1)


def mean_intensity(setup: SetUp) -> float:
    """Return the share of the power per steradian, on the axis, that a uniform pattern has."""
    on_axis = setup.projector.density_xyz(np.zeros(1), np.zeros(1), np.ones(1))
    return float(on_axis[0]) / (setup.pattern_size[0] * setup.pattern_size[1])


def _render(
    setup: SetUp, settings: CaptureSettings, lights: dict[str, Any], spp: int, seed: int
) -> NDArray[np.float32]:
    tissue = settings.tissue
    path = {"type": "path", "max_depth": settings.max_depth}
    if tissue.subsurface == "medium":
        boundary, medium = translucent_tissue(tissue)
        walk = {"type": "volpath", "max_depth": _LONGEST_WALK}
        return _image(_scene(setup, boundary, walk, lights, medium), spp, seed)
    if tissue.subsurface == "none":
        return _image(_scene(setup, wet_tissue(tissue), path, lights), spp, seed)
    inside = _scene(setup, dry_tissue(tissue), path, lights)
    points, pixels_per_mm = _seen(inside, setup)
    entered = subsurface_blur(
        _image(inside, spp, seed), points, pixels_per_mm, tissue.mean_free_path, tissue.base_color,
        index_of_refraction(tissue.specular),
    )  # fmt: skip
    direct = {"type": "path", "max_depth": 2}
    return entered + _image(_scene(setup, wet_surface(tissue), direct, lights), spp, seed)


def _image(scene: Any, spp: int, seed: int) -> NDArray[np.float32]:
    return np.array(mi.render(scene, spp=spp, seed=seed), np.float32)[..., :3]


def _seen(scene: Any, setup: SetUp) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the points (h, w, 3) that pixels see, mm, NaN = none, and pixels per mm (h, w)."""
    ray, width, height = pixel_rays(scene.sensors()[0])
    si = scene.ray_intersect_preliminary(ray, coherent=True)
    distance = dr.select(si.is_valid(), si.t, dr.nan)
    points = np.array(ray(distance), np.float32).T.reshape(height, width, 3)
    along = np.array(distance, np.float32).reshape(height, width)
    return points, np.float32(setup.camera.K[0, 0]) / along


def _scene(
    setup: SetUp,
    bsdf: dict[str, Any],
    integrator: dict[str, Any],
    lights: dict[str, Any],
    medium: dict[str, Any] | None = None,
) -> Any:
    return mi.load_dict({
        "type": "scene", "integrator": integrator, keys.CAMERA: _sensor(setup),
        keys.SURFACE: _surface(setup.mesh, bsdf, medium), **lights,
    })  # fmt: skip


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
    surface: Any = mi.Mesh(
        keys.SURFACE, len(mesh.vertices), len(mesh.faces), props=props, has_vertex_normals=True
    )
    parameters = mi.traverse(surface)
    parameters[keys.FACES] = mesh.faces.astype(np.uint32).ravel()
    parameters[keys.VERTEX_POSITIONS] = mesh.vertices.astype(np.float32).ravel()
    parameters.update()
    return surface

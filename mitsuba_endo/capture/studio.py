"""The Mitsuba scene of a photograph: mesh, tissue, camera, projector and lamp."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.laws import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..rendering import keys
from ..rendering.axes import to_world_from_pose
from ..rendering.untyped import mi
from ..shapes.mesh import Mesh
from .settings import CaptureSettings, Tissue

LAMP = "lamp"


class Studio:
    """One set-up, rendered once for the laser and once for the lamp."""

    def __init__(
        self,
        mesh: Mesh,
        camera: CameraModel,
        world_from_camera: RigidTransform,
        projector: ProjectorModel,
        projector_from_camera: RigidTransform,
        pattern: NDArray[np.float32],
        settings: CaptureSettings,
        pattern_size: tuple[int, int] | None,
    ) -> None:
        size = pattern_size or (pattern.shape[1], pattern.shape[0])
        world_from_projector = world_from_camera @ projector_from_camera.inverse()
        light = settings.light
        common = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": settings.max_depth},
            keys.CAMERA: _sensor(camera, world_from_camera),
            keys.SURFACE: _surface(mesh, settings.tissue),
        }
        self._laser: Any = mi.load_dict(common | {keys.PROJECTOR: _projector(
            projector, world_from_projector, pattern, size, light.projector_power)})  # fmt: skip
        self._lamp: Any = None
        if light.lamp:
            intensity = light.lamp * light.projector_power * _mean_density(projector, size)
            self._lamp = mi.load_dict(common | _lamps(
                world_from_camera, light.lamp_offset, intensity * np.array(light.lamp_color)
            ))  # fmt: skip

    def render(self, spp: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the radiance (h, w, 3) by the laser and by the lamp."""
        laser = np.array(mi.render(self._laser, spp=spp, seed=2 * seed), np.float32)[..., :3]
        if self._lamp is None:
            return laser, np.zeros_like(laser)
        lamp = np.array(mi.render(self._lamp, spp=spp, seed=2 * seed + 1), np.float32)[..., :3]
        return laser, lamp


def _pose(world_from_object: RigidTransform) -> Any:
    return mi.ScalarTransform4f(to_world_from_pose(world_from_object).tolist())


def _sensor(camera: CameraModel, world_from_camera: RigidTransform) -> dict[str, Any]:
    film = {"type": "hdrfilm", "width": camera.width, "height": camera.height,
            "rfilter": {"type": "box"}, "pixel_format": "rgb"}  # fmt: skip
    lens = dict(zip(keys.LENSES[camera.model], (float(k) for k in camera.distortion), strict=False))
    K = camera.K
    return {
        "type": "endoscope", "model": camera.model, "to_world": _pose(world_from_camera),
        "fx": float(K[0, 0]), "fy": float(K[1, 1]), "cx": float(K[0, 2]), "cy": float(K[1, 2]),
        "film": film, **lens,
    }  # fmt: skip


def _projector(
    projector: ProjectorModel,
    world_from_projector: RigidTransform,
    pattern: NDArray[np.float32],
    size: tuple[int, int],
    power: float,
) -> dict[str, Any]:
    image = np.ascontiguousarray(pattern, np.float32)
    coefficients = (float(k) for k in projector.distortion.coefficients)
    return {
        "type": "doe_projector", "law": projector.law, "to_world": _pose(world_from_projector),
        "width": size[0], "height": size[1], "focal": float(projector.focal),
        "centre_x": float(projector.centre[0]), "centre_y": float(projector.centre[1]),
        "aspect": float(projector.aspect), "power": power,
        "pattern": {"type": "bitmap", "bitmap": mi.Bitmap(image), "raw": True,
                    "wrap_mode": "clamp"},
        **dict(zip(keys.DISTORTION, coefficients, strict=False)),
    }  # fmt: skip


def _mean_density(projector: ProjectorModel, size: tuple[int, int]) -> float:
    """Return the share of the pattern's power per steradian on the axis of a uniform pattern."""
    return float(projector.density_xyz(np.zeros(1), np.zeros(1), np.ones(1))[0]) / (
        size[0] * size[1]
    )


def _lamps(
    world_from_camera: RigidTransform, offset: float, intensity: NDArray[np.float64]
) -> dict[str, Any]:
    """Return two light guides beside the lens that share the intensity (3,)."""
    ends = world_from_camera.apply(np.array([[-offset, 0.0, 0.0], [offset, 0.0, 0.0]]))
    return {
        f"{LAMP}_{i}": {
            "type": "point", "position": end.tolist(),
            "intensity": {"type": "rgb", "value": (intensity / 2).tolist()},
        }
        for i, end in enumerate(ends)
    }  # fmt: skip


def _surface(mesh: Mesh, tissue: Tissue) -> Any:
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(_bsdf(tissue))
    surface: Any = mi.Mesh(
        keys.SURFACE, len(mesh.vertices), len(mesh.faces), props=props, has_vertex_normals=True
    )
    parameters = mi.traverse(surface)
    parameters[keys.FACES] = mesh.faces.astype(np.uint32).ravel()
    parameters[keys.VERTEX_POSITIONS] = mesh.vertices.astype(np.float32).ravel()
    parameters.update()
    return surface


def _bsdf(tissue: Tissue) -> dict[str, Any]:
    wet: dict[str, Any] = {
        "type": "principled", "base_color": _colour(tissue),
        "roughness": tissue.roughness, "specular": tissue.specular,
        "clearcoat": tissue.clearcoat, "clearcoat_gloss": tissue.clearcoat_gloss,
    }  # fmt: skip
    if tissue.relief:
        fine = {"type": "tissue_relief", "slope": tissue.relief, "seed": tissue.seed}
        wet = {"type": "bumpmap", "relief": fine, "bsdf": wet}
    return {"type": "twosided", "bsdf": wet}


def _colour(tissue: Tissue) -> dict[str, Any]:
    base = {"type": "rgb", "value": list(tissue.base_color)}
    if not tissue.vessel_contrast:
        return base
    return {"type": "vessels", "base": base, "contrast": tissue.vessel_contrast,
            "scale": tissue.vessel_scale, "seed": tissue.seed}  # fmt: skip

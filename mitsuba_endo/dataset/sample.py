"""One sample: drawn, photographed, and everything that is true of it."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture.photograph import Photograph, load_scene, take_photograph
from ..decoding.grid_pattern import CodedGrid
from ..geometry.endoscope import Endoscope
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.ground_truth import GroundTruth, TrueFrame
from ..records.rig import Camera
from ..shapes.mesh import Mesh
from .asset_cache import AssetCache
from .config import Config
from .optics import draw_camera, draw_projector
from .pose_sampler import PoseSampler, SampledPoses
from .streams import stream
from .surfaces import DrawnSurface, draw_surface
from .truth import TruthMaps, truth_maps

SCHEMA = 1
"""Of a sample's description; changes whenever the meaning of a key does."""
MAP = "map.exr"
"""File of a sample's correspondences; also the frame's name in the truth."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A photograph with its truth."""

    index: int
    kind: str
    image: NDArray[np.uint8] | NDArray[np.uint16]
    """(H, W, 3), or (H, W) if gray, as the camera delivers it."""
    radiance: NDArray[np.float16]
    """(H, W, 3) linear RGB without any camera effect."""
    maps: TruthMaps
    mesh: Mesh
    """The surface in the camera's frame, mm."""
    truth: GroundTruth
    """Exact calibration."""
    description: dict[str, Any]
    """All that was drawn, as it stands in ``sample.json``."""


def make_sample(config: Config, index: int, assets: AssetCache) -> Sample:
    """Return the sample of this number; Mitsuba must be running.

    The same configuration and number give the same sample to the last bit on one machine, if
    Dr.Jit uses one thread: with several, sums of light come in a different order each time.

    Raises:
        InputError: what was drawn makes no picture, e.g. no place for the camera was found.
    """
    surface, scene = draw_surface(config.scenes, stream(config.seed, "surface", index), assets)
    optics = stream(config.seed, "optics", index)
    variant = int(optics.integers(config.pattern.variants))
    grid = assets.grid(variant)
    size = grid.width, grid.height
    camera = draw_camera(config.camera, optics)
    projector = draw_projector(config.projector, size, optics)
    settings = config.capture.draw(stream(config.seed, "capture", index))
    # One scene for poses, picture and truth: its search tree takes long.
    photographed = load_scene(
        surface.mesh, camera, projector, assets.pattern(variant), settings, size
    )
    sampler = PoseSampler(
        config.placing, surface.mesh, photographed.surface, camera, projector, size
    )
    poses = sampler.sample(
        surface.views, scene.view, config.projector, stream(config.seed, "place", index)
    )
    hits = photographed.set_poses(
        poses.endoscope.world_from_camera, poses.endoscope.projector_from_camera
    )
    seed = int(stream(config.seed, "photograph", index).integers(2**30))
    picture = take_photograph(photographed, camera, settings, seed)
    maps = truth_maps(photographed.surface, surface.mesh, poses.endoscope, grid, hits)
    description = {
        "schema": SCHEMA, "index": index, "seed": config.seed, "units": "mm",
        **_described(surface, poses, grid),
        "pattern": {"variant": variant, **asdict(grid)},
        "photograph": {"seed": seed, **settings.model_dump(mode="json")},
    }  # fmt: skip
    return _sample(index, surface, poses.endoscope, picture, maps, size, description)


def _sample(
    index: int,
    surface: DrawnSurface,
    endoscope: Endoscope,
    picture: Photograph,
    maps: TruthMaps,
    size: tuple[int, int],
    description: dict[str, Any],
) -> Sample:
    camera_from_world = endoscope.world_from_camera.inverse()
    return Sample(
        index=index,
        kind=surface.kind,
        image=picture.image,
        radiance=np.minimum(picture.radiance, np.finfo(np.float16).max).astype(np.float16),
        maps=maps,
        mesh=Mesh(camera_from_world.apply(surface.mesh.vertices), surface.mesh.faces),
        truth=GroundTruth([TrueFrame(MAP, endoscope)], size),
        description=description,
    )


def _described(surface: DrawnSurface, poses: SampledPoses, grid: CodedGrid) -> dict[str, Any]:
    """Return what sample.json says of surface and geometry."""
    endoscope = poses.endoscope
    camera_from_world = endoscope.world_from_camera.inverse()
    return {
        "kind": surface.kind,
        "surface": surface.parameters,
        "polyps": [_in_camera(polyp, camera_from_world) for polyp in surface.polyps],
        "camera": Camera.from_model(endoscope.camera).model_dump(mode="json"),
        "projector": {
            "law": endoscope.projector.law, "width": grid.width, "height": grid.height,
            **_projector_values(endoscope.projector),
        },
        "world_from_camera": _pose_values(endoscope.world_from_camera),
        "projector_from_camera": _pose_values(endoscope.projector_from_camera),
        "placing": {"lit": poses.lit, "tries": poses.tries},
    }  # fmt: skip


def _projector_values(projector: ProjectorModel) -> dict[str, Any]:
    return {
        "focal": float(projector.focal),
        "centre": [float(c) for c in projector.centre],
        "aspect": float(projector.aspect),
        "distortion": [float(k) for k in projector.distortion.coefficients],
    }


def _pose_values(pose: RigidTransform) -> dict[str, Any]:
    return {"R": pose.R.tolist(), "t": pose.t.tolist()}


def _in_camera(polyp: dict[str, Any], camera_from_world: RigidTransform) -> dict[str, Any]:
    """Return a polyp's truth in the camera's frame, in which everything else is."""
    return {
        **polyp,
        **{name: camera_from_world.apply(np.array(polyp[name])).tolist()
           for name in ("centre", "base")},
        "normal": camera_from_world.rotate(np.array(polyp["normal"])).tolist(),
    }  # fmt: skip

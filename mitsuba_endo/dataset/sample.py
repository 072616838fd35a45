"""One sample: drawn, photographed, and everything that is true of it."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture.photograph import develop, open_studio
from ..decode.grid_pattern import CodedGrid
from ..geometry.cameras import CameraModel
from ..geometry.laws import ProjectorModel
from ..records.rig import Camera
from ..records.solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
)
from ..shapes.mesh import Mesh
from .config import Config
from .optics import ProjectorDraw, draw_camera, draw_projector
from .placing import Placed, find_place
from .streams import stream
from .surfaces import Surface, draw_surface
from .truth import TruthMaps, truth_maps
from .workshop import Workshop

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
    truth: Solution
    """Exact calibration."""
    description: dict[str, Any]
    """All that was drawn, as it stands in ``sample.json``."""


def make_sample(config: Config, index: int, workshop: Workshop) -> Sample:
    """Return the sample of this number; Mitsuba must be running.

    The same configuration and number give the same sample to the last bit on one machine, if
    Dr.Jit uses one thread: with several, sums of light come in a different order each time.

    Raises:
        InputError: what was drawn makes no picture, e.g. no place for the camera was found.
    """
    surface, drawn_from = draw_surface(
        config.scenes, stream(config.seed, "surface", index), workshop
    )
    optics = stream(config.seed, "optics", index)
    variant = int(optics.integers(config.pattern.variants))
    grid = workshop.grid(variant)
    size = grid.width, grid.height
    camera = draw_camera(config.camera, optics)
    projector = draw_projector(config.projector, size, optics)
    settings = config.capture.draw(stream(config.seed, "capture", index))
    # One scene for the search of a place, the picture and the truth: its search tree takes long.
    studio = open_studio(surface.mesh, camera, projector, workshop.pattern(variant), settings, size)
    placed = find_place(
        surface.stance, drawn_from.view, config.placing, surface.mesh, studio.surface, camera,
        projector, size, ProjectorDraw(config.projector), stream(config.seed, "place", index),
    )  # fmt: skip
    hits = studio.place(placed.world_from_camera, placed.projector_from_camera)
    seed = int(stream(config.seed, "photograph", index).integers(2**30))
    picture = develop(studio, camera, settings, seed)
    maps = truth_maps(
        studio.surface, surface.mesh, camera, placed.world_from_camera, projector,
        placed.projector_from_camera, grid, hits,
    )  # fmt: skip
    camera_from_world = placed.world_from_camera.inverse()
    description = {
        "schema": SCHEMA, "index": index, "seed": config.seed, "units": "mm",
        **_described(surface, camera, projector, placed, grid),
        "pattern": {"variant": variant, **asdict(grid)},
        "photograph": {"seed": seed, **settings.model_dump(mode="json")},
    }  # fmt: skip
    return Sample(
        index=index,
        kind=surface.kind,
        image=picture.image,
        radiance=np.minimum(picture.radiance, np.finfo(np.float16).max).astype(np.float16),
        maps=maps,
        mesh=Mesh(camera_from_world.apply(surface.mesh.vertices), surface.mesh.faces),
        truth=_truth(camera, projector, placed, size),
        description=description,
    )


def _described(
    surface: Surface,
    camera: CameraModel,
    projector: ProjectorModel,
    placed: Placed,
    grid: CodedGrid,
) -> dict[str, Any]:
    """Return what sample.json says of surface and geometry."""
    poses = {
        name: {"R": pose.R.tolist(), "t": pose.t.tolist()}
        for name, pose in (
            ("world_from_camera", placed.world_from_camera),
            ("projector_from_camera", placed.projector_from_camera),
        )
    }
    return {
        "kind": surface.kind,
        "surface": surface.parameters,
        "polyps": [_in_camera(polyp, placed) for polyp in surface.polyps],
        "camera": Camera.from_model(camera).model_dump(mode="json"),
        "projector": {
            "law": projector.law, "width": grid.width, "height": grid.height,
            "focal": float(projector.focal), "centre": [float(c) for c in projector.centre],
            "aspect": float(projector.aspect),
            "distortion": [float(k) for k in projector.distortion.coefficients],
        },
        **poses,
        "placing": {"lit": placed.lit, "tries": placed.tries},
    }  # fmt: skip


def _in_camera(polyp: dict[str, Any], placed: Placed) -> dict[str, Any]:
    """Return a polyp's truth in the camera's frame, in which everything else is."""
    camera_from_world = placed.world_from_camera.inverse()
    return {
        **polyp,
        **{name: camera_from_world.apply(np.array(polyp[name])).tolist()
           for name in ("centre", "base")},
        "normal": camera_from_world.rotate(np.array(polyp["normal"])).tolist(),
    }  # fmt: skip


def _truth(
    camera: CameraModel, projector: ProjectorModel, placed: Placed, size: tuple[int, int]
) -> Solution:
    def exact(value: float | list[float]) -> Estimate:
        return Estimate(value=value, status="fixed")

    return Solution(
        outcome=Outcome.TRUTH,
        units="mm",
        scale="truth",
        camera=Camera.from_model(camera),
        projector=ProjectorEstimate(
            law=projector.law,
            width=size[0],
            height=size[1],
            focal=exact(float(projector.focal)),
            centre=exact([float(c) for c in projector.centre]),
            aspect=exact(float(projector.aspect)),
            distortion=exact([float(k) for k in projector.distortion.coefficients]),
        ),
        frames=[
            Frame(
                name=MAP,
                projector_from_camera=PoseEstimate.of(placed.projector_from_camera, status="fixed"),
                world_from_camera=PoseEstimate.of(placed.world_from_camera, status="fixed"),
            )
        ],
    )

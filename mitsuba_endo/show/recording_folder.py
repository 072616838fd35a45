"""The folder of a rendered sequence: maps or photographs, the rig to start from, and the truth."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..capture.photograph import load_scene, take_photograph
from ..capture.settings import CaptureSettings
from ..errors import InputError
from ..files import atomic_folder
from ..folder_mark import Kind
from ..png import write_png
from ..records.calibration import SurfaceEstimate
from ..records.correspondence import save_map
from ..records.ground_truth import save_truth
from ..records.known_input import known_rig, save_rig
from ..records.rig import Drift, Rig
from ..records.surface import save_surface
from ..records.trajectory import FrameRow
from ..rendering.moving_capture import MovingCapture
from ..rendering.pattern_truth import coded_grid
from .capture_folder import RIG, SURFACE, TRUTH
from .trajectory_files import save_trajectories

MAPS, IMAGES = "maps", "images"
DRIFT = Drift(insertion_mm=0.05, roll_deg=0.2, lateral_mm=0.02, tilt_deg=0.1)
"""From frame to frame; what the rendered projector's steps keep to. Chosen."""
Advance = Callable[[float, str], None]


def write_recording_folder(
    path: str | Path, capture: MovingCapture, spp: int | None, advance: Advance
) -> None:
    """Write what ``sequence`` takes and ``evaluate`` compares with.

    Files: ``maps/`` with the correspondence map of every frame, or ``images/`` with its photograph;
    ``rig.yaml`` without what is to be found; ``truth.json`` with all poses, ``truth_surface.ply``
    in the first camera's frame, and ``trajectory_camera.tum``, ``trajectory_projector.tum``.

    Args:
        path: the folder.
        capture: what to render.
        spp: samples per pixel of photographs; None: maps.
        advance: called with the share done and what is done.

    Raises:
        InputError: the folder cannot be written, or photographs of another pattern than the grid.
    """
    write = _maps(capture) if spp is None else _photographs(capture, spp)
    with atomic_folder(path, Kind.RECORDING) as folder:
        (folder / (MAPS if spp is None else IMAGES)).mkdir()
        for k in range(len(capture)):
            advance(k / len(capture), f"Frame {k + 1} of {len(capture)}")
            write(folder, k)
        truth = replace(capture.truth(), surface=SURFACE)
        save_truth(folder / TRUTH, truth)
        save_surface(folder / SURFACE, SurfaceEstimate(*capture.surface()))
        save_trajectories(folder, _rows(capture))
        save_rig(folder / RIG, with_drift(known_rig(truth)))


def with_drift(rig: Rig) -> Rig:
    """Return a rig that says how far the projector may move."""
    return rig.model_copy(update={"drift": DRIFT})


def _maps(capture: MovingCapture) -> Callable[[Path, int], None]:
    def write(folder: Path, k: int) -> None:
        save_map(folder / MAPS / f"{capture.name(k)}.exr", capture.map(k))

    return write


def _photographs(capture: MovingCapture, spp: int) -> Callable[[Path, int], None]:
    """Return what writes photographs; the scene is loaded once."""
    loaded, grid = capture.loaded, coded_grid(capture.loaded)
    if grid is None:
        raise InputError(
            "photographs are of the coded grid, and the scene projects another pattern",
            loaded.source, "leave --photographs out, or set the scene's pattern to pattern:coded",
        )  # fmt: skip
    settings, camera = CaptureSettings(spp=spp), loaded.camera()
    scene: Any = load_scene(
        loaded.surface(), camera, loaded.projector(), grid.image(), settings, loaded.pattern_size()
    )

    def write(folder: Path, k: int) -> None:
        if k in capture.nothing:
            image = np.zeros((camera.height, camera.width, 3), np.uint8)
        else:
            scene.set_poses(capture.world_from_camera(k), capture.projector_from_camera(k))
            image = take_photograph(scene, camera, settings, 1000 * capture.seed + k).image
        write_png(folder / IMAGES / f"{capture.name(k)}.png", image[..., ::-1])

    return write


def _rows(capture: MovingCapture) -> list[FrameRow]:
    return [
        FrameRow(
            k, capture.name(k), world_from_camera=capture.first_from_camera[k],
            projector_from_camera=capture.projector_from_camera(k),
        )
        for k in range(len(capture))
    ]  # fmt: skip

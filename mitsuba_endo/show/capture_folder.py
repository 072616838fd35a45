"""The folder of a synthetic capture: image, map, geometry, truth and the rig file to start from."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..files import atomic_folder
from ..folder_mark import Kind
from ..png import write_png
from ..records.calibration import SurfaceEstimate
from ..records.correspondence import save_map
from ..records.exr_files import write_exr
from ..records.ground_truth import save_truth
from ..records.known_input import known_rig, save_rig
from ..records.surface import save_surface
from ..rendering.pattern_truth import coded_grid, grid_truth
from ..rendering.render import Capture
from ..rendering.scene import LoadedScene
from .grid_truth_file import GRID_TRUTH, save_grid_truth
from .tonemap import tonemap

MAP = "map.exr"
"""Correspondence map; also the frame's name in the truth."""
RIG = "rig.yaml"
TRUTH = "truth.json"
SURFACE = "truth_surface.ply"


def write_capture_folder(path: str | Path, capture: Capture, loaded: LoadedScene) -> None:
    """Write a capture so that it can be calibrated and evaluated.

    Files: ``image.exr`` (linear RGB), ``image.png``, ``map.exr`` (projector coordinates of lit
    pixels), ``depth.exr`` (mm along the optical axis), ``normals.exr`` (camera frame),
    ``masks.exr`` (lit by the projector; surface seen), ``rig.yaml`` (without what is to be found),
    ``truth.json`` and ``truth_surface.ply`` (mm, camera frame); for ``pattern:coded`` also
    ``truth_grid.exr``: phase, node and code at every pixel, also where it is not lit.

    Raises:
        InputError: the folder cannot be written.
    """
    with atomic_folder(path, Kind.CAPTURE) as folder:
        write_exr(folder / "image.exr", {c: capture.image[..., i] for i, c in enumerate("RGB")})
        write_png(folder / "image.png", tonemap(capture.image)[..., ::-1])
        save_map(folder / MAP, capture.correspondences())
        write_exr(folder / "depth.exr", {"Z": capture.depth})
        axes = {f"normal.{c}": capture.normals[..., i] for i, c in enumerate("xyz")}
        write_exr(folder / "normals.exr", axes)
        masks = {"visible": capture.visible, "camera": capture.camera_mask}
        write_exr(folder / "masks.exr", {k: v.astype(np.float32) for k, v in masks.items()})
        save_rig(folder / RIG, known_rig(capture.truth))
        save_truth(folder / TRUTH, replace(capture.truth, surface=SURFACE))
        save_surface(folder / SURFACE, _surface_in_camera(loaded))
        grid = coded_grid(loaded)
        if grid is not None:
            truth = grid_truth(grid, capture.projector, loaded.pattern_size())
            save_grid_truth(folder / GRID_TRUTH, truth)


def _surface_in_camera(loaded: LoadedScene) -> SurfaceEstimate:
    mesh = loaded.surface()
    camera_from_world = loaded.world_from_camera().inverse()
    vertices = camera_from_world.apply(np.asarray(mesh.vertices, np.float64))
    return SurfaceEstimate(vertices, np.asarray(mesh.faces, np.int64))

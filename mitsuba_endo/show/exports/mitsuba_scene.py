"""The calibrated scene for Mitsuba."""

from pathlib import Path

import numpy as np

from ...errors import InputError
from ...files import atomic_folder
from ...folder_mark import Kind
from ...records.solution import Solution
from ...records.surface import load_surface, save_surface
from ..scene_file import save_scene
from .registry import register_exporter
from .required_values import projector_pose, required_camera, required_projector, required_size


@register_exporter("mitsuba", "folder with scene.xml and surface.ply", Kind.SCENE)
def write_mitsuba(solution: Solution, folder: Path, path: Path) -> None:
    """Write the scene of the first frame with the surface beside it.

    Raises:
        InputError: a value was not determined, or the folder cannot be written.
    """
    if solution.surface is None:
        raise InputError("surface is missing", "solution.json", "calibrate again")
    first = solution.frames[0]
    camera, pose = required_camera(solution), projector_pose(first)
    projector, size = required_projector(solution, first), required_size(solution)
    surface = load_surface(folder / solution.surface)
    distance = float(np.median(np.linalg.norm(surface.vertices, axis=-1)))
    with atomic_folder(path, Kind.SCENE) as aside:
        save_surface(aside / "surface.ply", surface)
        save_scene(aside / "scene.xml", camera, projector, size, pose, "surface.ply", distance)

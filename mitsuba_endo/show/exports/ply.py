"""The surface alone."""

from pathlib import Path

from ...errors import InputError
from ...records.solution import Solution
from ...records.surface import load_surface, save_surface
from .registry import register_exporter


@register_exporter("ply", "surface as PLY, std_0 = standard deviation per vertex")
def write_ply(solution: Solution, folder: Path, path: Path) -> None:
    """Write the first frame's surface, in its camera's frame and the solution's unit.

    Raises:
        InputError: there is no surface, or the file cannot be written.
    """
    if solution.surface is None:
        raise InputError("surface is missing", "solution.json", "calibrate again")
    save_surface(path, load_surface(folder / solution.surface))

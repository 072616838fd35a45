"""The truth of a synthetic capture beside its result: only for looking at, after the solve."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..evaluate.depth import RayCaster
from ..evaluate.errors import Pair, first_from_truth, match_frames
from ..evaluate.shape import Alignment, alignment_of
from ..geometry.transforms import RigidTransform
from ..reading.regular import is_file
from ..records.calibration import Calibration, SurfaceEstimate
from ..records.solution import Solution, load_solution
from ..records.surface import load_surface
from .frame_poses import Floats, FramePoses, frame_poses

NAMES = ("truth.json", "../truth.json", "../capture/truth.json")
"""Where a truth may lie, from the result's folder."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A truth in the solution's unit."""

    path: Path
    poses: list[FramePoses]
    """Of the solution's frames, in the true frame of the solution's first camera."""
    surface: SurfaceEstimate | None
    """In that frame."""
    alignment: Alignment
    """What was taken out of the difference: nothing, or the scale that the solution lacks."""


def find_truth(result: str | Path, solution: Solution) -> Path | None:
    """Return the truth that lies with a result and names the same frames, if there is one."""
    folder = Path(result)
    folder = folder if folder.is_dir() else folder.parent
    for name in NAMES:
        path = folder / name
        if is_file(path):
            try:
                truth = load_solution(path)
                _, matched_by = match_frames(solution, truth)
            except InputError:
                continue  # another result's, or no truth at all
            named = matched_by == "name" or _is_decoded(solution, truth, path.parent)
            if named and truth.camera == solution.camera:
                return path.resolve()
    return None


def _is_decoded(solution: Solution, truth: Solution, folder: Path) -> bool:
    """Tell whether the one frame is called as the capture's image, from which it was decoded."""
    image = folder / Path(solution.frames[0].name).with_suffix(".png").name
    return len(truth.frames) == 1 and is_file(image)


def read_truth(path: str | Path, solution: Solution) -> tuple[Solution, list[Pair]]:
    """Read a truth's numbers; return them, and each frame of the solution with the true one.

    Raises:
        InputError: it cannot be read, or its frames or their size are not those of the solution.
    """
    truth = load_solution(path)
    pairs, _ = match_frames(solution, truth)
    return truth, pairs


def load_truth(path: str | Path, calibration: Calibration) -> Truth:
    """Read a truth and bring it into the solution's unit.

    Raises:
        InputError: as :func:`read_truth`; its surface cannot be read; or the solution is up to
            scale and nothing tells the scale.
    """
    path, solution = Path(path), calibration.solution
    truth, pairs = read_truth(path, solution)
    same = truth.model_copy(update={"frames": [true for _, true in pairs]})
    moved = first_from_truth(truth, pairs[0][1])
    surface = None
    if truth.surface is not None and moved is not None:
        folder = path if path.is_dir() else path.parent
        loaded = load_surface(folder / truth.surface)
        surface = SurfaceEstimate(moved.apply(loaded.vertices), loaded.faces)
    alignment: Alignment = "none" if solution.units == truth.units else "scale"
    factor = _factor(calibration, surface, alignment)
    if surface is not None:
        surface = SurfaceEstimate(factor * surface.vertices, surface.faces)
    return Truth(path, [_scaled(p, factor) for p in frame_poses(same)], surface, alignment)


def _factor(
    calibration: Calibration, surface: SurfaceEstimate | None, alignment: Alignment
) -> float:
    """Return what lengths of the truth are multiplied by."""
    if alignment == "none":
        return 1.0
    if surface is None:
        found = "there is no true surface"
    else:
        found = alignment_of(calibration.surface, surface, calibration.camera, alignment)
    if isinstance(found, str):
        raise InputError(f"the solution is up to scale, and {found}", "truth", "leave it out")
    return 1 / found.scale


def _scaled(at: FramePoses, factor: float) -> FramePoses:
    return FramePoses(
        at.name,
        *(
            None if p is None else RigidTransform(p.R, factor * p.t)
            for p in (at.first_from_camera, at.first_from_projector)
        ),
    )


def surface_error(surface: SurfaceEstimate, truth: SurfaceEstimate) -> Floats:
    """Return how much farther (V,) from the camera each vertex is than the true surface.

    Along the ray from the camera's centre, as the surface's standard deviation; NaN where that ray
    misses the truth. Both in the camera's frame and the same unit.
    """
    distance = np.linalg.norm(surface.vertices, axis=-1)
    rays = surface.vertices / distance[:, None]
    return distance - RayCaster(truth.vertices, truth.faces).range(np.zeros(3), rays)

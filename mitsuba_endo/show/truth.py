"""The truth of a synthetic capture beside its result: only for looking at, after the solve."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..evaluate.depth import RayCaster
from ..evaluate.shape import Alignment, alignment_of
from ..evaluate.surfaces import camera_from_surface
from ..evaluate.truths import Truths, load_truths
from ..geometry.transforms import RigidTransform
from ..reading.regular import is_file
from ..records.calibration import Calibration, SurfaceEstimate
from ..records.solution import Solution
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
                truths = load_truths([path])
                _, matched = truths.match(solution)
            except InputError:
                continue  # another result's, or no truth at all
            if matched == "name" and truths.record.camera == solution.camera:
                return path.resolve()
    return None


def read_truth(path: str | Path, solution: Solution) -> tuple[Truths, list[int]]:
    """Read a truth's numbers; return them, and the index of each frame's true one.

    Raises:
        InputError: it cannot be read, or its frames or their size are not those of the solution.
    """
    truths = load_truths([path])
    return truths, truths.match(solution)[0]


def load_truth(path: str | Path, calibration: Calibration) -> Truth:
    """Read a truth and bring it into the solution's unit.

    Args:
        path: a truth, or a folder of captures, as ``evaluate`` takes them.
        calibration: what was found.

    Raises:
        InputError: it cannot be read, its frames or their size are not those of the solution, its
            surface cannot be read, or the solution is up to scale and nothing tells the scale.
    """
    path, solution = Path(path), calibration.solution
    truths, chosen = read_truth(path, solution)
    truth = truths.record
    same = truth.model_copy(update={"frames": [truth.frames[j] for j in chosen]})
    surface = _surface(truths, chosen[0])
    alignment: Alignment = "none" if solution.units == truth.units else "scale"
    factor = _factor(calibration, surface, alignment)
    if surface is not None:
        surface = SurfaceEstimate(factor * surface.vertices, surface.faces)
    return Truth(path, [_scaled(p, factor) for p in frame_poses(same)], surface, alignment)


def _surface(truths: Truths, index: int) -> SurfaceEstimate | None:
    """Return the true surface in a frame's camera, None where either is not known."""
    moved, path = camera_from_surface(truths, index), truths.surfaces[index]
    if path is None or moved is None:
        return None
    loaded = load_surface(path)
    return SurfaceEstimate(moved.apply(loaded.vertices), loaded.faces)


def _factor(
    calibration: Calibration, surface: SurfaceEstimate | None, alignment: Alignment
) -> float:
    """Return what lengths of the truth are multiplied by."""
    if alignment == "none":
        return 1.0
    if surface is None:
        similarity = "there is no true surface"
    else:
        similarity = alignment_of(calibration.surface, surface, calibration.camera, alignment)
    if isinstance(similarity, str):
        raise InputError(f"the solution is up to scale, and {similarity}", "truth", "leave it out")
    return 1 / similarity.scale


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

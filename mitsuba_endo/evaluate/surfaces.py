"""The surfaces of a solution against those with which its frames were captured."""

from collections.abc import Sequence
from pathlib import Path

from ..geometry.transforms import RigidTransform
from ..reading.regular import is_file
from ..records.calibration import SurfaceEstimate
from ..records.solution import Frame, Solution
from ..records.surface import load_surface, own_surface_name
from .shape import Alignment, Lighting, ShapeErrors, compare_shape, model_and_size
from .truths import Truths

_SHARED = "the frame has no surface of its own"


def surface_errors(
    solution: Solution,
    truths: Truths,
    chosen: Sequence[int],
    folder: str | Path | None,
    alignment: Alignment,
) -> list[ShapeErrors | str]:
    """Return the errors of the first surface, and of those that other frames have of their own.

    Args:
        solution: what was found.
        truths: with true surfaces.
        chosen: index of every frame's true one.
        folder: of the solution's surfaces; None: they are not compared.
        alignment: as of :func:`compare_shape`.

    Returns:
        One a frame: the errors, mm, or the sentence why there are none.
    """
    why = _incomparable(solution, truths, chosen[0], folder, alignment)
    if why is not None or folder is None:
        return [str(why)] * len(chosen)
    files = [Path(folder) / str(solution.surface)]
    files += [Path(folder) / own_surface_name(k) for k in range(1, len(chosen))]
    return [
        _one(solution, truths, j, file, alignment) if k == 0 or is_file(file) else _SHARED
        for k, (j, file) in enumerate(zip(chosen, files, strict=True))
    ]


def _incomparable(
    solution: Solution, truths: Truths, first: int, folder: str | Path | None, alignment: Alignment
) -> str | None:
    """Say why no surface can be compared, or None."""
    truth = truths.record
    if solution.surface is None:
        return "the solution has no surface"
    if folder is None:
        return "the folder of the solution's surface is not given"
    if truths.surfaces[first] is None:
        return truths.without_surface
    if truth.camera is None and solution.camera is None:
        return "neither side has camera intrinsics"
    if truth.units != "mm":
        return "the truth is up to scale"
    if solution.units != "mm" and alignment in ("none", "rigid"):
        return f"the solution is up to scale, which alignment '{alignment}' leaves as it is"
    return None


def _one(
    solution: Solution, truths: Truths, index: int, file: Path, alignment: Alignment
) -> ShapeErrors | str:
    camera = truths.record.camera or solution.camera
    path, moved = truths.surfaces[index], camera_from_surface(truths, index)
    if moved is None:
        return "the true camera pose of the solution's first frame is null"
    if path is None or camera is None:
        return truths.without_surface
    surface, true = load_surface(file), load_surface(path)
    true = SurfaceEstimate(moved.apply(true.vertices), true.faces)
    lighting = _lighting(truths.record, truths.record.frames[index])
    return compare_shape(surface, true, camera.to_model(), lighting, alignment)


def camera_from_surface(truths: Truths, index: int) -> RigidTransform | None:
    """Return what takes a frame's true surface into that frame's camera; None if not known.

    A true surface is given in its truth's first camera, which the solution may have left out.
    """
    owner = truths.owners[index]
    if owner == index:
        return RigidTransform.identity()
    first = truths.record.frames[owner].world_from_camera.to_transform()
    other = truths.record.frames[index].world_from_camera.to_transform()
    return None if first is None or other is None else other.inverse() @ first


def _lighting(truth: Solution, frame: Frame) -> Lighting | None:
    projector = truth.projector
    if frame.focal is not None:
        projector = projector.model_copy(update={"focal": frame.focal})
    light, pose = model_and_size(projector), frame.projector_from_camera.to_transform()
    return None if light is None or pose is None else Lighting(*light, pose)

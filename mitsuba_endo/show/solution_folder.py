"""The folder that a calibration leaves behind."""

import csv
import shutil
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import yaml

from ..files import atomic_folder, atomic_path
from ..folder_mark import Kind
from ..records.calibration import Calibration, TraceRow
from ..records.checkpoint import FILE as CHECKPOINT
from ..records.checkpoint import save_checkpoint
from ..records.correspondence import save_map
from ..records.history import FILE as HISTORY
from ..records.history import save_history, thinned
from ..records.rig import Rig
from ..records.solution import Solution, save_solution
from ..records.surface import MODES, SURFACE, own_surface_name, save_modes, save_surface
from ..records.trajectory import save_frames
from .extras import EXTRAS, check_extras
from .map_names import map_names, observed_names
from .photographs import StoredPhotographs, write_photographs
from .read_folder import DECODED, save_observed
from .report import REPORT, save_report
from .scene_file import save_scene
from .trajectory_files import FRAMES, frame_rows, save_trajectories
from .view import view_surface

SCENE = "scene.xml"


def write_solution_folder(
    path: str | Path,
    calibration: Calibration,
    rig: Rig | None = None,
    decoded: str | Path | None = None,
    extras: Sequence[str] = (),
) -> Solution:
    """Write everything a calibration found, all of it or nothing.

    ====================  =========================================================================
    solution.json         values, uncertainty, verdict
    surface.ply           the surface in the first camera's frame, ``std_0`` per vertex
    surface_01.ply ...    those of the other frames, in their cameras' frames, where frames do not
                          share one
    scene.xml             the calibrated scene; left out, with a warning in solution.json, where a
                          value it needs could not be determined
    rendered*.exr         projector coordinates rendered from the solution, one file a frame
    observed*.exr         projector coordinates as they came in, and which of them were used
    surface_modes.npz     what the errors of a surface's vertices have in common
    frames.csv            a line a frame: poses with standard deviations, residuals, coverage, and
                          why a frame was left out
    trajectory_*.tum      camera and projector in the world, as the RGB-D benchmark has them
    trace.csv             the iterations
    history.npz           where they stood: poses and coarse surfaces, for the viewer
    state.npz             from which ``calibrate --resume`` goes on
    rig.yaml              the rig with all defaults filled in, if given
    report.html           look at this first: verdict, maps, numbers, provenance; needs no network
    decoded/              copies of the files of the folder ``decoded``, if given
    ====================  =========================================================================

    And, of :data:`.extras.EXTRAS`, the files that ``extras`` names.

    Returns:
        The solution as written: with the surface's file name and any new warning.

    Raises:
        InputError: the folder holds other files or cannot be written, or an unknown extra.
    """
    check_extras(extras, "extras")
    with atomic_folder(path, Kind.CALIBRATION) as folder:
        view = view_surface(calibration.surface, calibration.camera)
        solution = _write_scene(folder, calibration, rig)
        warnings = [w for name in extras for w in EXTRAS[name](folder, calibration, view)]
        solution = solution.model_copy(update={"warnings": [*solution.warnings, *warnings]})
        save_solution(folder / "solution.json", solution)
        save_surface(folder / SURFACE, calibration.surface)
        for k, surface in calibration.own_surfaces.items():
            save_surface(folder / own_surface_name(k), surface)
        _save_modes(folder, calibration)
        rows = frame_rows(solution)
        save_frames(folder / FRAMES, rows)
        save_trajectories(folder, rows)
        save_trace(folder / "trace.csv", calibration.trace)
        if calibration.history:
            save_history(folder / HISTORY, thinned(calibration.history))
        if calibration.checkpoint is not None:
            save_checkpoint(folder / CHECKPOINT, calibration.checkpoint)
        names = [frame.name for frame in calibration.frames]
        for name, frame in zip(map_names(names), calibration.frames, strict=True):
            save_map(folder / name, frame.rendered)
        for name, frame in zip(observed_names(names), calibration.frames, strict=True):
            save_observed(folder / name, frame)
        if rig is not None:
            save_rig(folder / "rig.yaml", rig)
        if decoded is not None:
            shutil.copytree(decoded, folder / DECODED)
        write_photographs(folder / DECODED, calibration.photographs)
        photographs = StoredPhotographs(folder / DECODED, names)
        shown = replace(calibration, solution=solution, photographs=photographs)
        save_report(folder / REPORT, [(Path(path).name, shown)], [view])
    return solution


def _save_modes(folder: Path, calibration: Calibration) -> None:
    surfaces = {own_surface_name(0): calibration.surface} | {
        own_surface_name(k): surface for k, surface in calibration.own_surfaces.items()
    }
    if any(surface.modes is not None for surface in surfaces.values()):
        save_modes(folder / MODES, surfaces)


def save_trace(path: str | Path, trace: list[TraceRow]) -> None:
    """Write the iterations as CSV; an empty field is a value that does not exist."""
    with atomic_path(path) as aside, aside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = [f.name for f in fields(TraceRow) if f.name != "lengths"]
        writer.writerow(names)
        writer.writerows([getattr(row, name) for name in names] for row in trace)


def save_rig(path: Path, rig: Rig) -> None:
    """Write a rig with all defaults filled in."""
    with atomic_path(path) as aside:
        text = yaml.safe_dump(rig.model_dump(mode="json"), sort_keys=False)
        aside.write_text(text, encoding="utf-8")


def _write_scene(folder: Path, calibration: Calibration, rig: Rig | None) -> Solution:
    """Write scene.xml if everything in it is known; return the solution, which says so if not."""
    solution = calibration.solution.model_copy(update={"surface": SURFACE})
    first = solution.frames[0]
    projector = solution.projector
    if first.focal is not None:
        projector = projector.model_copy(update={"focal": first.focal})
    model, pose = projector.to_model(), first.projector_from_camera.to_transform()
    width = projector.width or (rig.projector.width if rig else None)
    height = projector.height or (rig.projector.height if rig else None)
    missing = [
        name
        for name, value in (
            ("the projector's intrinsics", model), ("the projector's pose", pose),
            ("the pattern's size", width and height),
        )
        if value is None
    ]  # fmt: skip
    if model is None or pose is None or width is None or height is None:
        warning = f"{SCENE} is left out, because {' and '.join(missing)} could not be determined"
        return solution.model_copy(update={"warnings": [*solution.warnings, warning]})
    distance = float(np.median(np.linalg.norm(calibration.surface.vertices, axis=-1)))
    save_scene(folder / SCENE, calibration.camera, model, (width, height), pose, SURFACE, distance)
    return solution

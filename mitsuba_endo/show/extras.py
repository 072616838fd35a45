"""What a solution folder holds on request: a new kind of file is one function here."""

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..png import write_png
from ..records.calibration import Calibration
from ..records.exr_files import write_exr
from . import figures
from .frame_views import FrameViews
from .map_names import file_names
from .view import SurfaceView

UNUSED, USED = 128, 255
"""Values in a mask: decoded but not used by the solver, and used."""
Save = Callable[[Path, Calibration, SurfaceView], list[str]]
EXTRAS: dict[str, Save] = {}
"""By the name that ``calibrate --save`` takes."""


def extra(name: str) -> Callable[[Save], Save]:
    """Register a function that writes files into a folder and returns warnings."""

    def register(save: Save) -> Save:
        EXTRAS[name] = save
        return save

    return register


def check_extras(names: Sequence[str], where: str, choices: Collection[str] = EXTRAS) -> None:
    """Refuse names of files that are not written.

    Args:
        names: that were asked for.
        where: option or argument.
        choices: those that there are.

    Raises:
        InputError: names the first one and those that there are.
    """
    for name in names:
        if name not in choices:
            raise InputError(f"'{name}' is unknown", where, f"choose from {', '.join(choices)}")


def write_depth(path: Path, points: NDArray[np.float64]) -> None:
    """Write z of a frame's points (H, W, 3) as OpenEXR, NaN = no surface."""
    write_exr(path, {"Z": points[..., 2].astype(np.float32)})


def write_points(path: Path, points: NDArray[np.float64]) -> None:
    """Write those of a frame's points (H, W, 3) that there are as a PLY."""
    data: Any = trimesh.PointCloud(points[np.isfinite(points).all(-1)]).export(file_type="ply")
    with atomic_path(path) as aside:
        aside.write_bytes(data)


@extra("depth")
def save_depth(folder: Path, calibration: Calibration, _view: SurfaceView) -> list[str]:
    """Write ``depth*.exr``: z in each frame's camera, the solution's unit, NaN = no surface."""
    return _each_frame(folder, calibration, "depth", ".exr", write_depth)


@extra("points")
def save_points(folder: Path, calibration: Calibration, _view: SurfaceView) -> list[str]:
    """Write ``points*.ply``: what each frame's pixels see, in its camera's frame, one a pixel."""
    return _each_frame(folder, calibration, "points", ".ply", write_points)


@extra("masks")
def save_masks(folder: Path, calibration: Calibration, _view: SurfaceView) -> list[str]:
    """Write ``mask*.png``: 255 where the solver used a correspondence, 128 where it did not."""
    names = [frame.name for frame in calibration.frames]
    for name, frame in zip(file_names("mask", names, ".png"), calibration.frames, strict=True):
        decoded = np.isfinite(frame.observed).all(-1)
        mask = np.select([frame.used, decoded], [USED, UNUSED], 0)
        write_png(folder / name, mask.astype(np.uint8))
    return []


@extra("pictures")
def save_pictures(folder: Path, calibration: Calibration, view: SurfaceView) -> list[str]:
    """Write ``overview.png``, all at one look, and its panels and others at full size."""
    frames, solution, trace = calibration.frames, calibration.solution, calibration.trace
    scale = trace[-1].scale_px if trace else None
    pictures = {
        "overview": figures.overview_figure(calibration, view),
        "observed": figures.coordinates_figure(frames, "observed"),
        "rendered": figures.coordinates_figure(frames, "rendered"),
        "residual": figures.residual_figure(frames),
        "histogram": figures.histogram_figure(frames, solution.noise_px, scale),
        "surface": figures.surface_figure(view, figures.unit_name(solution)),
    }
    if trace:
        pictures["convergence"] = figures.convergence_figure(trace)
    for name, figure in pictures.items():
        figures.save_figure(folder / f"{name}.png", figure)
    return []


def _each_frame(
    folder: Path,
    calibration: Calibration,
    kind: str,
    suffix: str,
    write: Callable[[Path, NDArray[np.float64]], None],
) -> list[str]:
    """Write a file of every frame's points; warn of frames whose camera pose is not known."""
    views, warnings = FrameViews(calibration), []
    names = [frame.name for frame in calibration.solution.frames]
    for k, name in enumerate(file_names(kind, names, suffix)):
        try:
            points = views.points(k)
        except InputError as error:
            warnings.append(f"{name} is left out: {error.what}")
            continue
        write(folder / name, points)
    return warnings

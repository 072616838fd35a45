"""A solution folder back as the calibration that wrote it."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading.regular import TABLE, is_file, read_text
from ..records.calibration import Calibration, FrameMaps, SurfaceEstimate, TraceRow
from ..records.exr_files import read_exr, write_exr
from ..records.history import load_history
from ..records.map_arrays import CHANNELS
from ..records.solution import load_solution
from ..records.surface import load_with_modes, own_surface_name
from .map_names import map_names, observed_names
from .photographs import StoredPhotographs

DECODED = "decoded"
"""Maps, photographs and pictures of the grids found, where images were given."""
USED = "used"
"""Channel of the observed maps: 1 where the solver used the correspondence."""


class StoredFrames(Sequence[FrameMaps]):
    """The frames of a folder, each read when it is first asked for; the viewer wants few of them.

    Raises:
        InputError: a file is missing; or, when its frame is asked for, damaged.
    """

    def __init__(self, folder: Path, names: list[str]) -> None:
        self._files = [
            (name, folder / rendered, folder / observed)
            for name, rendered, observed in zip(
                names, map_names(names), observed_names(names), strict=True
            )
        ]
        self._read: dict[int, FrameMaps] = {}
        for path in (path for _, *paths in self._files for path in paths):
            if not is_file(path):
                raise InputError("no such file", str(path), "calibrate again")

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, index: Any) -> Any:
        chosen = range(len(self))[index]
        return self._frame(chosen) if isinstance(chosen, int) else [self._frame(k) for k in chosen]

    def _frame(self, index: int) -> FrameMaps:
        if index not in self._read:
            self._read[index] = _frame(*self._files[index])
        return self._read[index]


def save_observed(path: str | Path, frame: FrameMaps) -> None:
    """Write the observed coordinates and which of them were used as OpenEXR."""
    channels = {name: frame.observed[..., i] for i, name in enumerate(CHANNELS)}
    write_exr(path, {**channels, USED: frame.used.astype(np.float32)})


def read_solution_folder(path: str | Path) -> Calibration:
    """Read what pictures, reports and the viewer are made of; the checkpoint stays.

    Raises:
        InputError: a file is missing or damaged; maps are read by :class:`StoredFrames`.
    """
    folder = Path(path)
    if folder.name == "solution.json":
        folder = folder.parent
    solution = load_solution(folder / "solution.json")
    if solution.camera is None or solution.surface is None:
        what = "camera" if solution.camera is None else "surface"
        raise InputError(f"{what} is missing", str(folder / "solution.json"), "calibrate again")
    names = [frame.name for frame in solution.frames]
    frames = StoredFrames(folder, names)
    surface = load_with_modes(folder / solution.surface)
    trace = _trace(folder / "trace.csv")
    return Calibration(
        solution, solution.camera.to_model(), surface, frames, trace,
        own_surfaces=_own_surfaces(folder, len(names)), history=load_history(folder),
        photographs=StoredPhotographs(folder / DECODED, names),
    )  # fmt: skip


def _own_surfaces(folder: Path, frames: int) -> dict[int, SurfaceEstimate]:
    """Return the surfaces of frames after the first, where frames do not share one."""
    paths = {k: folder / own_surface_name(k) for k in range(1, frames)}
    return {k: load_with_modes(path) for k, path in paths.items() if is_file(path)}


def read_observed(path: Path) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Read what :func:`save_observed` wrote: coordinates (H, W, 2) and which were used (H, W).

    Raises:
        InputError: missing or damaged file.
    """
    channels = read_exr(path)
    if USED not in channels:
        raise InputError(f"channel {USED} is missing", str(path), "calibrate again")
    return _stacked(channels, path), channels[USED] > 0


def _frame(name: str, rendered: Path, observed: Path) -> FrameMaps:
    q, used = read_observed(observed)
    return FrameMaps(name, q, _stacked(read_exr(rendered), rendered), used)


def _stacked(channels: dict[str, NDArray[np.float32]], path: Path) -> NDArray[np.float32]:
    missing = [name for name in CHANNELS if name not in channels]
    if missing:
        raise InputError(f"channel {missing[0]} is missing", str(path), "calibrate again")
    return np.stack([channels[name] for name in CHANNELS], -1)


def _trace(path: Path) -> list[TraceRow]:
    text = read_text(path, TABLE, "calibrate again")
    try:
        return [
            TraceRow(
                int(row["iteration"]), float(row["seconds"]), float(row["cost"]),
                float(row["focal"]) if row["focal"] else None, float(row["damping"]),
                float(row["scale_px"]), float(row["step"]),
                float(row["fixed_cost"]) if row.get("fixed_cost") else None,
            )
            for row in csv.DictReader(text.splitlines())
        ]  # fmt: skip
    except (KeyError, ValueError, TypeError, csv.Error):
        raise InputError("is not a table of iterations", str(path), "calibrate again") from None

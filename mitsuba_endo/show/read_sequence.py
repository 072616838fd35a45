"""A sequence's folder back as what evaluation and report need of it."""

from pathlib import Path

from ..errors import InputError
from ..evaluate.tracked_frames import TrackedFrames
from ..reading.regular import is_file
from ..records.solution import load_solution
from ..records.surface import SURFACE, load_surface
from ..records.trajectory import load_frames
from .trajectory_files import FRAMES

KEYFRAMES = "keyframes"
"""A solution folder, which ``view``, ``evaluate`` and ``export`` read."""
MESH = "mesh.ply"
"""Of the part with the most frames."""


def is_sequence_folder(path: str | Path) -> bool:
    """Tell whether a folder was written by ``sequence``, not by ``calibrate``."""
    folder = Path(path)
    return is_file(folder / FRAMES) and not is_file(folder / SURFACE)


def keyframes_of(path: Path) -> Path:
    """Return the solution folder in a sequence's folder; another folder as it is.

    Raises:
        InputError: the sequence has none.
    """
    if not is_sequence_folder(path):
        return path
    if not (path / KEYFRAMES).is_dir():
        raise InputError("holds no keyframes", str(path), "it is unfinished, or has no surface")
    return path / KEYFRAMES


def tracked_of(path: Path) -> TrackedFrames | None:
    """Return the frames of a sequence's folder; None of another."""
    return read_sequence_folder(path) if is_sequence_folder(path) else None


def read_sequence_folder(path: str | Path) -> TrackedFrames:
    """Read frames, solution and surface.

    Raises:
        InputError: a file is missing or damaged.
    """
    folder = Path(path)
    rows = load_frames(folder / FRAMES)
    if not any(not row.lost for row in rows):
        raise InputError("has no frame with a pose", str(folder / FRAMES), "track it again")
    mesh = load_surface(folder / MESH) if is_file(folder / MESH) else None
    return TrackedFrames(load_solution(folder), rows, mesh)

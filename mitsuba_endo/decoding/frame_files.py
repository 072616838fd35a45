"""The files of frames that paths lead to: maps of a folder, or else its images."""

from collections.abc import Sequence
from pathlib import Path

from ..records.correspondence import READABLE
from .image_files import images_of, visible


def frame_files(paths: Sequence[Path]) -> list[Path]:
    """Return files of maps as they are, folders of maps as their files, all else as it is.

    A folder that holds maps and pictures, as the command ``decode`` writes it, is one of maps.

    Raises:
        InputError: a folder cannot be read.
    """
    return [file for path in paths for file in (_maps(path) or [path])]


def is_map(path: Path) -> bool:
    """Tell whether a path is a map's, by its suffix."""
    return path.suffix.lower() in READABLE


def _maps(folder: Path) -> list[Path]:
    if not folder.is_dir() or not any(map(is_map, visible(folder))):
        return []
    return images_of(folder, READABLE)

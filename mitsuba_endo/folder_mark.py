"""The mark of a folder that this program wrote: what kind it is, and the list of its files."""

import contextlib
import json
import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from .errors import InputError

NAME = ".mitsuba-endo"
LARGEST = 64 << 20
"""Bytes; the list of a million files is smaller."""


class Kind(StrEnum):
    """What a folder holds."""

    CALIBRATION = "a calibration"
    CAPTURE = "a rendered capture"
    COLMAP = "a COLMAP model"
    DEMO = "a demo"
    MAPS = "decoded maps"
    PATTERNS = "pattern images"
    ROS = "camera files of ROS"
    SAMPLE = "a sample of a dataset"
    SCENE = "a Mitsuba scene"
    RECORDING = "a rendered sequence"
    SEQUENCE = "a tracked sequence"
    UNFINISHED = "an unfinished sequence"
    VIEWS = "views for training"


@dataclass(frozen=True)
class Mark:
    """Contents of a folder's mark."""

    kind: str
    files: frozenset[str]
    """Paths in the folder, with ``/``, without the mark's own."""


def write_mark(folder: Path, kind: Kind) -> None:
    """Mark a folder as written, with all that is in it now."""
    text = json.dumps({"kind": kind, "files": sorted(files_in(folder))}, indent=1)
    (folder / NAME).write_text(text + "\n", encoding="utf-8")


def read_mark(folder: Path) -> Mark | None:
    """Return the mark of a folder, or None if it has none.

    Raises:
        InputError: the mark holds no list, as that of version 0.1, or is damaged.
    """
    path = folder / NAME
    if not path.is_file() or path.is_symlink():
        return None
    try:
        if path.stat().st_size > LARGEST:
            raise ValueError
        data = json.loads(path.read_text(encoding="utf-8"))
        return Mark(str(data["kind"]), frozenset(str(name) for name in data["files"]))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise InputError(
            "has no list of what was written to it, as folders of version 0.1 have none",
            str(folder), "remove it yourself or choose another folder",
        ) from None  # fmt: skip


def files_in(folder: Path) -> set[str]:
    """Return every file and link below a folder but its mark, relative to it, with ``/``."""
    names = set()
    for root, folders, files in os.walk(folder, onerror=_refuse):
        links = [name for name in folders if os.path.islink(os.path.join(root, name))]
        names |= {Path(root, name).relative_to(folder).as_posix() for name in (*files, *links)}
    return names - {NAME}


def remove_marked(folder: Path, mark: Mark) -> None:
    """Remove the files of a mark and the folders that are empty then; others stay."""
    for name in (*mark.files, NAME):
        with contextlib.suppress(OSError):
            (folder / name).unlink()
    for root, _, _ in os.walk(folder, topdown=False):
        with contextlib.suppress(OSError):
            os.rmdir(root)


def _refuse(error: OSError) -> None:
    raise error

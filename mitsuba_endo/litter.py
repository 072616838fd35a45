"""Names of things half written, and their removal once the process that made them is gone."""

import contextlib
import hashlib
import os
import platform
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Literal

from .errors import InputError
from .folder_mark import read_mark, remove_marked
from .interrupts import uninterrupted

State = Literal["partial", "old"]
LONGEST_NAME = 255
"""Bytes that file systems allow for a name."""
_FORM = re.compile(r"\.(?P<of>.*)\.endo-(?P<host>\w{8})-(?P<pid>\d+)-\w{8}\.(?P<state>partial|old)")
_SCRATCH = "mitsuba-endo"


def aside_of(path: Path, state: State) -> Path:
    """Return an unused hidden name beside ``path`` that says which process it belongs to.

    It keeps the suffix, by which many writers choose the format.
    """
    tag = f".endo-{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.{state}"
    suffix = path.suffix if state == "partial" else ""
    stem = path.name.removesuffix(suffix) if suffix else path.name
    room = LONGEST_NAME - len(os.fsencode(tag + suffix)) - 1
    while len(os.fsencode(stem)) > room:
        stem = stem[:-1]
    return path.with_name(f".{stem}{tag}{suffix}")


def sweep(folder: str | Path, alone: bool = False) -> list[Path]:
    """Remove what dead processes of this machine left half written in a folder; return it.

    With ``alone``, whoever calls holds the folder's lock, so that all that is half written is left
    over, also from other machines. An older result is moved back if the process that had moved it
    aside died before it put the new one in its place.
    """
    leftovers = [
        (path, match) for path in _entries(Path(folder)) if (match := _FORM.match(path.name))
    ]
    dead = [(path, m) for path, m in leftovers if alone or _is_dead(m)]
    for path, match in dead:
        with contextlib.suppress(OSError, InputError):
            if match["state"] == "old":
                _settle_old(path, path.with_name(match["of"]))
            else:
                remove(path)
    return [path for path, _ in dead]


def _is_dead(match: re.Match[str]) -> bool:
    return match["host"] == _machine() and not _alive(int(match["pid"]))


def _settle_old(old: Path, home: Path) -> None:
    if home.exists():
        mark = read_mark(old)
        if mark is not None:
            remove_marked(old, mark)
    elif len(os.fsencode(old.name)) < LONGEST_NAME - 1:  # else its name was cut
        os.replace(old, home)


def sweep_scratch() -> list[Path]:
    """Remove the scratch folders of dead processes; return them."""
    return sweep(tempfile.gettempdir())


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a temporary folder that is gone afterwards, at the latest with the next command."""
    sweep_scratch()
    folder = aside_of(Path(tempfile.gettempdir()) / _SCRATCH, "partial")
    try:  # from before it is there: a signal may come as soon as it is
        _make_scratch(folder)
        yield folder
    finally:
        remove(folder)


def _make_scratch(folder: Path) -> None:
    try:
        folder.mkdir(mode=0o700)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"no temporary folder can be made ({reason})", tempfile.gettempdir(),
            "make room there, or set TMPDIR to another folder",
        ) from error  # fmt: skip


def remove(path: Path) -> None:
    """Remove a file or folder that this program made, as far as that is possible.

    Signals wait until it is gone.
    """
    with uninterrupted():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
            return
        with contextlib.suppress(OSError):  # what led here is the fault to tell
            path.unlink(missing_ok=True)


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []


@lru_cache(maxsize=1)
def _machine() -> str:
    """Return what tells machines, their starts and their containers apart: numbers of processes
    mean something within one only.
    """
    parts = [platform.node()]
    with contextlib.suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii"))
        parts.append(os.readlink("/proc/self/ns/pid"))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:8]


def _alive(pid: int) -> bool:
    if os.name != "posix":  # elsewhere os.kill ends the process
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True

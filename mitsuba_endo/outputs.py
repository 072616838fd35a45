"""Whether an output may be written where it is asked for: no file of anybody else is replaced."""

import os
from collections.abc import Iterable
from pathlib import Path

from .errors import InputError
from .folder_mark import Kind, files_in, read_mark
from .litter import LONGEST_NAME, sweep


def prepare_folder(path: str | Path, kind: Kind, inputs: Iterable[str | Path] = ()) -> None:
    """Refuse, before any work is done, a folder that could not be replaced at the end.

    What a dead process left half written beside it is removed.

    Args:
        path: the output folder.
        kind: what will be written there.
        inputs: files and folders that the command reads.

    Raises:
        InputError: ``path`` is a file, is, contains or lies in an input, holds another kind of
            output or a file that this program did not write, or its parent cannot be written.
    """
    path = Path(path)
    check_name(path)
    for given in inputs:
        _check_apart(path, Path(given))
    sweep(path.absolute().parent)
    check_folder(path, kind)


def prepare_file(
    path: str | Path, inputs: Iterable[str | Path] = (), own: Iterable[str] = ()
) -> None:
    """Refuse an output file in whose place an input lies.

    Args:
        path: the output file.
        inputs: files that the command reads, and marked folders.
        own: names under which the command's output may lie in an input folder already.

    Raises:
        InputError: ``path`` is an input, or one of the files with which an input folder was
            written.
    """
    path = Path(path)
    check_name(path)
    for given in inputs:
        _check_no_input(path, Path(given), frozenset(own))
    sweep(path.absolute().parent)


def check_folder(path: str | Path, kind: Kind) -> None:
    """Refuse a folder that may not be replaced by one of a kind.

    Raises:
        InputError: as :func:`prepare_folder`.
    """
    path = Path(path)
    check_name(path)
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise InputError("exists and is not a folder", str(path), "choose another output folder")
    try:
        if path.is_dir() and any(path.iterdir()):
            _check_own(path, kind)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be looked into ({reason})", str(path), "choose another") from None
    parent = next(p for p in path.absolute().parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(
            "the folder cannot be written", str(path), "choose a folder you may write to"
        )


def check_name(path: Path) -> None:
    """Refuse a path that no file system takes.

    Raises:
        InputError: a name in it is too long, or it holds a zero byte.
    """
    if "\0" in str(path):
        raise InputError("holds a zero byte", repr(str(path)), "choose another name")
    if any(len(os.fsencode(part)) > LONGEST_NAME for part in path.parts):
        raise InputError(
            f"holds a name of more than {LONGEST_NAME} bytes", str(path), "choose a shorter name"
        )


def _check_own(path: Path, kind: Kind) -> None:
    mark = read_mark(path)
    if mark is None:
        raise InputError(
            "holds files that mitsuba-endo did not write", str(path), "choose an empty folder"
        )
    if mark.kind != kind:
        raise InputError(f"holds {mark.kind}, not {kind}", str(path), "choose another folder")
    foreign = sorted(files_in(path) - mark.files)
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise InputError(
            f"holds {foreign[0]}{more}, which mitsuba-endo did not write with {kind}", str(path),
            "move it away or choose another folder",
        )  # fmt: skip


def _check_apart(path: Path, given: Path) -> None:
    out, read = path.resolve(), given.resolve()
    if not read.exists():
        return
    if out == read:
        how = "is also an input of this command"
    elif out in read.parents:
        how = f"contains {given}, an input of this command"
    elif read in out.parents:
        how = f"lies in {given}, an input of this command"
    else:
        return
    raise InputError(how, str(path), "choose another output folder")


def _check_no_input(path: Path, given: Path, own: frozenset[str]) -> None:
    out, read = path.resolve(), given.resolve()
    if out == read or _same_file(out, read):
        raise InputError("is also an input of this command", str(path), "choose another name")
    if not read.is_dir() or read not in out.parents or not out.is_file() or out.name in own:
        return
    try:
        mark = read_mark(read)
        listed = mark is not None and out.relative_to(read).as_posix() in mark.files
    except InputError:
        listed = True  # for all that is known
    if listed:
        raise InputError(
            f"is a file of {given}, an input of this command", str(path), "choose another name"
        )


def _same_file(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:
        return False

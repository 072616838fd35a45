"""Writing that is never seen half done: write aside, then rename."""

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError
from .folder_mark import Kind, Mark, read_mark, remove_marked, write_mark
from .litter import aside_of, remove
from .outputs import check_folder, check_name

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
"""Errors that another name does not mend."""
_TRIES = 20
"""Of putting a folder in its place while others do the same."""


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that replaces it if the block ends well.

    The temporary name keeps the suffix, by which many writers choose the format.

    Raises:
        InputError: the folder cannot be written.
    """
    path = Path(path)
    check_name(path)
    _make_parent(path)
    aside = aside_of(path, "partial")
    try:
        # Plain open() under the user's umask: mkstemp would leave the file readable by its owner
        # only. Not every writer (OpenEXR) reports a folder it may not write to as an OSError.
        aside.touch()
        yield aside
        os.replace(aside, path)
    except OSError as error:
        raise not_writable(path, error) from error
    finally:
        remove(aside)


@contextlib.contextmanager
def atomic_folder(path: str | Path, kind: Kind) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``path`` if the block ends well.

    An existing folder is replaced as a whole at the end, so that ``path`` is absent, the old
    result, or the complete new one, and never a mixture; an existing file is refused.

    Args:
        path: the folder.
        kind: what is written there. Its mark says so and lists the files, and only a folder of
            this kind that holds nothing else is ever replaced.

    Raises:
        InputError: ``path`` is a file, a folder of another kind or with foreign files, or cannot
            be written.
    """
    path = Path(path).absolute()
    _check_steady(path, kind)
    _make_parent(path)
    aside = aside_of(path, "partial")
    try:  # from before it is there: a signal may come as soon as it is
        aside.mkdir()
        yield aside
        write_mark(aside, kind)
        _swap(aside, path, kind)
    except OSError as error:
        raise not_writable(path, error) from error
    finally:
        remove(aside)


def _swap(aside: Path, path: Path, kind: Kind) -> None:
    """Rename ``aside`` to ``path``, moving an older result out of the way first."""
    for left in reversed(range(_TRIES)):
        try:
            _replace_folder(aside, path, kind)
        except OSError as error:
            # Another process has put its own there, or taken it away, between two calls.
            raced = error.errno in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT)
            if not raced or not left or not aside.exists():
                raise
        else:
            return


def _replace_folder(aside: Path, path: Path, kind: Kind) -> None:
    if not path.exists():
        os.replace(aside, path)
        return
    _check_steady(path, kind)  # once more: files may have come since the work began
    old = aside_of(path, "old")
    os.replace(path, old)
    mark = read_mark(old)  # nobody else moves it there
    try:
        os.replace(aside, path)
    except BaseException:  # Ctrl-C between the two renames must not lose the older result
        _give_back(old, path, mark)
        raise
    _remove_old(old, mark)


def _give_back(old: Path, path: Path, mark: Mark | None) -> None:
    """Put an older result back, unless another process has put its own in its place."""
    with contextlib.suppress(OSError):
        if not path.exists():
            os.replace(old, path)
            return
    _remove_old(old, mark)


def _remove_old(old: Path, mark: Mark | None) -> None:
    if mark:
        remove_marked(old, mark)
    else:  # it was empty
        old.rmdir()


def _check_steady(path: Path, kind: Kind) -> None:
    """Check a folder as :func:`check_folder` does, again if it was replaced meanwhile.

    Another process that writes the same folder takes it away between two looks.
    """
    for left in reversed(range(_TRIES)):
        before = _identity(path)
        try:
            check_folder(path, kind)
        except InputError:
            steady = before is not None and _identity(path) == before
            if steady or not left:
                raise
        else:
            return


def _identity(path: Path) -> tuple[int, int] | None:
    """Return what tells a folder from another at the same path, None where there is none."""
    try:
        status = path.lstat()
    except (OSError, ValueError):  # no such folder, or a name that none can have
        return None
    return status.st_ino, status.st_ctime_ns


def _make_parent(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_writable(path, error) from error


def not_writable(path: str | Path, error: OSError) -> InputError:
    """Return the sentence for what the system says of writing a file or folder."""
    reason = (error.strerror or str(error)).lower()
    if error.errno in FULL:
        todo = "make room or choose a folder on another disk"
    elif error.errno is None:  # a library's word for whatever happened
        todo = "see whether the disk is full, or choose another folder"
    else:
        todo = "choose a folder you may write to"
    return InputError(f"cannot be written ({reason})", str(path), todo)

"""Writing that is never seen half done: write aside, then rename. What damaged files raise."""

import contextlib
import os
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from .errors import InputError

DAMAGED_NPZ = (
    KeyError, IndexError, ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What reading an npz file raises that is cut off or holds other arrays than expected."""


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that replaces it if the block ends well.

    The temporary name keeps the suffix, by which many writers choose the format.

    Raises:
        InputError: the folder cannot be written.
    """
    path = Path(path)
    _make_parent(path)
    # Plain open() under the user's umask: mkstemp would leave the file readable by its owner only.
    aside = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        # Not every writer (OpenEXR) reports a folder it may not write to as an OSError.
        aside.touch()
        yield aside
        os.replace(aside, path)
    except OSError as error:
        raise _not_writable(path, error) from error
    finally:
        aside.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """Yield a temporary folder that becomes ``path`` if the block ends well.

    An existing folder is replaced as a whole at the end, so that ``path`` is absent, the old
    result, or the complete new one, and never a mixture; an existing file is refused.

    Raises:
        InputError: ``path`` is a file, a folder that holds foreign files, or cannot be written.
    """
    path = Path(path).absolute()
    check_output_folder(path)
    _make_parent(path)
    try:
        aside = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent))
    except OSError as error:
        raise _not_writable(path, error) from error
    try:
        yield aside
        umask = os.umask(0)
        os.umask(umask)
        aside.chmod(0o777 & ~umask)
        (aside / _MARK).touch()
        _swap(aside, path)
    except OSError as error:
        raise _not_writable(path, error) from error
    finally:
        shutil.rmtree(aside, ignore_errors=True)


_MARK = ".mitsuba-endo"


def check_output_folder(path: str | Path) -> None:
    """Refuse, before any work is done, a folder that could not be replaced at the end.

    Raises:
        InputError: ``path`` is a file, holds files that this program did not write, or its
            parent cannot be written.
    """
    path = Path(path)
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise InputError("exists and is not a folder", str(path), "choose another output folder")
    if path.is_dir() and any(path.iterdir()) and not (path / _MARK).exists():
        raise InputError(
            "holds files that mitsuba-endo did not write", str(path), "choose an empty folder"
        )
    parent = next(p for p in path.absolute().parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise InputError(
            "the folder cannot be written", str(path), "choose a folder you may write to"
        )


def _swap(aside: Path, path: Path) -> None:
    """Rename ``aside`` to ``path``, moving an older result out of the way first."""
    if not path.exists():
        os.replace(aside, path)
        return
    old = path.with_name(f".{path.name}.{os.getpid()}.old")
    os.replace(path, old)
    try:
        os.replace(aside, path)
    except BaseException:  # Ctrl-C between the two renames must not lose the older result
        if not path.exists():
            os.replace(old, path)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _make_parent(path: Path) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _not_writable(path, error) from error


def _not_writable(path: Path, error: OSError) -> InputError:
    reason = error.strerror or str(error)
    return InputError(
        f"cannot be written ({reason.lower()})", str(path), "choose a folder you may write to"
    )

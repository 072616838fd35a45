"""Regular files of a bearable size: no pipe, device or folder, nothing that fills the memory."""

import os
import stat
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError

MIB = 1 << 20
"""Bytes."""
VARIABLE = "MITSUBA_ENDO_LIMIT_"
"""Environment variables of this name and a kind's, in MiB, replace the kind's limit."""


@dataclass(frozen=True)
class SizeLimit:
    """How large a kind of file, or what becomes of it in memory, may be."""

    name: str
    what: str
    """In words, with its article."""
    mib: int
    """Largest size, MiB, unless the environment says otherwise."""

    @property
    def variable(self) -> str:
        return f"{VARIABLE}{self.name.upper()}"

    def limit(self) -> int:
        """Return the largest size, bytes.

        Raises:
            InputError: the environment variable is no number.
        """
        text = os.environ.get(self.variable, "")
        if not text:
            return self.mib * MIB
        if not (text.isascii() and text.isdigit() and 0 < len(text) < 10):
            raise InputError("is no number of MiB", self.variable, "give a whole number")
        return int(text) * MIB

    def check(self, size: int, where: str | Path) -> None:
        """Refuse a size, bytes, above the limit.

        Raises:
            InputError: it says how to raise the limit.
        """
        if size > self.limit():
            needed = -(-size // MIB)
            raise InputError(
                f"takes {needed} MiB, and {self.what} may take {self.limit() // MIB}", str(where),
                f"set the environment variable {self.variable}={needed} if it is right",
            )  # fmt: skip


# YAML is read at a third of a MiB a second.
YAML = SizeLimit("yaml", "a YAML file", 1)
JSON = SizeLimit("json", "a JSON file", 32)
TABLE = SizeLimit("table", "a table", 32)
SCENE = SizeLimit("scene", "a scene or OpenCV file", 16)
MAP = SizeLimit("map", "a map", 512)
ARRAYS = SizeLimit("arrays", "the arrays of a file", 512)
IMAGE = SizeLimit("image", "an image", 256)
PIXELS = SizeLimit("pixels", "an image in memory", 256)
VIDEO = SizeLimit("video", "a video", 65536)
MESH = SizeLimit("mesh", "a mesh", 256)
NETWORK = SizeLimit("network", "a network", 256)
SHARD = SizeLimit("shard", "a shard", 1 << 20)
ANY = SizeLimit("file", "a file", 2048)


def exists(path: str | Path) -> bool:
    """Tell whether a path leads to anything; a name that no system takes does not."""
    try:
        os.stat(path)
    except (OSError, ValueError):
        return False
    return True


def is_file(path: str | Path) -> bool:
    """Tell whether a path leads to a regular file; a name that no system takes does not."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def regular(path: str | Path, kind: SizeLimit, missing: str = "no such file",
            todo: str = "check the path") -> int:  # fmt: skip
    """Return the size of a file, bytes, that may be read.

    Raises:
        InputError: it is missing, not regular, unreadable, or too large for its kind.
    """
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(missing, str(path), todo) from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    if stat.S_ISDIR(status.st_mode):
        raise InputError("is a folder", str(path), "give a file")
    if not stat.S_ISREG(status.st_mode):
        raise InputError("is a pipe or a device", str(path), "give a regular file")
    kind.check(status.st_size, path)
    return status.st_size


def read_bytes(path: str | Path, kind: SizeLimit, missing: str = "no such file",
               todo: str = "check the path") -> bytes:  # fmt: skip
    """Read a file whole.

    Raises:
        InputError: as :func:`regular`.
    """
    regular(path, kind, missing, todo)
    try:
        with Path(path).open("rb") as file:
            data = file.read(kind.limit() + 1)  # a file may grow, and some say no size
    except OSError as error:
        raise _unreadable(path, error) from None
    kind.check(len(data), path)
    return data


def read_text(path: str | Path, kind: SizeLimit, todo: str = "check the path") -> str:
    """Read a text in UTF-8.

    Raises:
        InputError: as :func:`regular`, or it is no text.
    """
    try:
        return read_bytes(path, kind, todo=todo).decode("utf-8")
    except UnicodeDecodeError:
        raise InputError("is not a text file", str(path), todo) from None


def _unreadable(path: str | Path, error: OSError | ValueError) -> InputError:
    reason = getattr(error, "strerror", None) or str(error)
    return InputError(f"cannot be read ({reason.lower()})", str(path), "check the path")

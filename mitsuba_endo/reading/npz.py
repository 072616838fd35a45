"""Arrays of npz files, each checked against the file before memory is taken for it."""

import contextlib
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .regular import ARRAYS, regular

_BROKEN = (
    ValueError, TypeError, KeyError, IndexError, OSError, EOFError, RuntimeError, OverflowError,
    MemoryError, SyntaxError, RecursionError, NotImplementedError, struct.error,
    zipfile.BadZipFile, zlib.error, tokenize.TokenError,
)  # fmt: skip
"""What zipfile and NumPy raise for damaged files, whose headers are Python literals."""
_ENCRYPTED = 0x1
"""Bit 0 of the general purpose flags in ZIP's specification."""
_HEADER = 10_000
"""Characters of an array's header; ours have a hundred."""

Shape = Sequence[int | None]
"""Lengths of an array's axes; None stands for any."""


class Arrays:
    """The arrays of an open npz file."""

    def __init__(self, file: zipfile.ZipFile, source: str, todo: str) -> None:
        self._file, self.source, self._todo = file, source, todo
        members = {info.filename: info for info in file.infolist()}
        self._members = {
            name.removesuffix(".npy"): info
            for name, info in members.items()
            if name.endswith(".npy")
        }
        ARRAYS.check(sum(info.file_size for info in self._members.values()), source)

    @property
    def names(self) -> list[str]:
        """Names of the arrays."""
        return list(self._members)

    def __contains__(self, name: str) -> bool:
        return name in self._members

    def get(self, name: str, shape: Shape | None = None, kinds: str = "fiu") -> NDArray[Any]:
        """Return an array.

        Args:
            name: of the array.
            shape: that it must have; None takes any.
            kinds: letters of NumPy's ``dtype.kind`` that are accepted.

        Raises:
            InputError: missing, damaged, or of another shape or type.
        """
        if name not in self._members:
            raise InputError(f"array '{name}' is missing", self.source, self._todo)
        array = self._read(self._members[name])
        fits = shape is None or _fits(array.shape, shape)
        if not fits or array.dtype.kind not in kinds:
            form = "x".join(map(str, array.shape)) or "a single value"
            raise InputError(f"array '{name}' is {array.dtype} {form}", self.source, self._todo)
        return array

    def _read(self, info: zipfile.ZipInfo) -> NDArray[Any]:
        if info.flag_bits & _ENCRYPTED:
            raise ValueError("encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError("compressed in a way that NumPy does not write")
        with self._file.open(info) as member:
            return _array(member, info.file_size)


@contextlib.contextmanager
def open_npz(path: str | Path, what: str = "npz file", todo: str = "make it again",
             missing: str = "no such file") -> Iterator[Arrays]:  # fmt: skip
    """Yield the arrays of an npz file.

    Args:
        path: the file.
        what: how it is called where it is damaged.
        todo: what to do then.
        missing: what is said where it is not there.

    Raises:
        InputError: missing, damaged, or arrays larger than the limit; also for what reading raises
            within the block.
    """
    regular(path, ARRAYS, missing)
    try:
        with zipfile.ZipFile(path) as file:
            yield Arrays(file, str(path), todo)
    except InputError:
        raise
    except _BROKEN:
        if _is_array(path):
            raise InputError("is an array, not an npz file", str(path), "use numpy.savez") from None
        raise InputError(f"is not a readable {what}", str(path), todo) from None


def read_npy(path: str | Path) -> NDArray[Any]:
    """Return the array of an npy file.

    Raises:
        InputError: missing, damaged, or larger than the limit.
    """
    size = regular(path, ARRAYS)
    try:
        with Path(path).open("rb") as file:
            return _array(file, size)
    except _BROKEN:
        raise InputError("is not a readable npy file", str(path), "make it again") from None


def _array(file: IO[bytes], file_size: int) -> NDArray[Any]:
    """Read an array that fills the rest of an open file."""
    shape, fortran, dtype = _header(file)
    if dtype.kind not in "biufcU" or dtype.hasobject or dtype.fields:
        raise ValueError("no numbers or texts")
    size = math.prod(shape) * dtype.itemsize
    if any(n < 0 for n in shape) or size > file_size:
        raise ValueError("larger than its file")
    data = file.read(size + 1)
    if len(data) != size:
        raise ValueError("cut short")
    array = np.frombuffer(bytearray(data), dtype) if size else np.zeros(0, dtype)
    return array.reshape(shape, order="F" if fortran else "C")


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = np.lib.format.read_magic(member)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(member, max_header_size=_HEADER)
    return np.lib.format.read_array_header_2_0(member, max_header_size=_HEADER)


def _fits(shape: tuple[int, ...], wanted: Shape) -> bool:
    return len(shape) == len(wanted) and all(
        w is None or n == w for n, w in zip(shape, wanted, strict=True)
    )


def _is_array(path: str | Path) -> bool:
    try:
        with Path(path).open("rb") as file:
            return file.read(6) == b"\x93NUMPY"
    except OSError:
        return False

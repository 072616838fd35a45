"""A checksum over all arrays of an npz file: what is read is what was written.

A zip file's own checksums cover one array each, so that a file may lack an array, hold that of
another file, or hold numbers that somebody changed, and still be sound for them.
"""

import hashlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading.npz import Arrays

SEAL = "seal"
"""The array that holds the checksum."""
_BYTES = 16
"""Of the checksum: against accidents, not against somebody who makes one anew."""


def seal_of(arrays: Iterable[tuple[str, NDArray]]) -> NDArray[np.uint8]:
    """Return the checksum (16,) of arrays with their names, types and shapes, in any order."""
    each = sorted((name, _digest(array)) for name, array in arrays)
    whole = hashlib.blake2b(digest_size=_BYTES)
    for name, digest in each:
        whole.update(f"{len(name)} {name} ".encode() + digest)
    return np.frombuffer(whole.digest(), np.uint8)


def check_seal(data: Arrays, todo: str) -> None:
    """Compare an open file with its checksum.

    Args:
        data: the file.
        todo: what to do where it differs.

    Raises:
        InputError: an array was changed, added or taken away, or there is no checksum.
    """
    stored = data.get(SEAL, (_BYTES,), "u")
    # One after the other: together they may fill the memory.
    seal = seal_of((name, data.get(name, kinds="biufcU")) for name in data.names if name != SEAL)
    if not np.array_equal(stored, seal):
        raise InputError("is not as it was written: its checksum differs", data.source, todo)


def _digest(array: NDArray) -> bytes:
    form = f"{array.dtype.str} {array.shape} ".encode()
    return hashlib.blake2b(form + array.tobytes(), digest_size=_BYTES).digest()

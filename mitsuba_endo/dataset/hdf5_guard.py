"""Reading groups of HDF5 files that somebody else may have written or damaged."""

import math
from typing import Any

from ..reading.regular import ARRAYS
from .contents import Arrays

BROKEN = (
    OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError,
    MemoryError, IndexError, NotImplementedError, ImportError,
)  # fmt: skip
"""What h5py raises for damaged files."""


def texts_and_arrays(group: Any, texts: tuple[str, ...]) -> tuple[dict[str, str], Arrays]:
    """Return the texts and all arrays of a group; links to other files are not followed.

    Raises:
        InputError: they would take more memory than is allowed.
        one of ``BROKEN``: damage.
    """
    import h5py  # pyright: ignore[reportMissingImports]

    for name in group:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise ValueError("leads elsewhere")
        data = group[name]
        if not isinstance(data, h5py.Dataset) or data.is_virtual or data.external:
            raise ValueError("holds its data elsewhere")
    source = group.file.filename
    ARRAYS.check(sum(math.prod(d.shape) * max(1, d.dtype.itemsize) for d in group.values()), source)
    said = {name: group[name].asstr()[()] for name in texts}
    arrays: Arrays = {name: group[name][()] for name in group if name not in texts}
    if any(array.dtype.kind not in "biuf" for array in arrays.values()):
        raise ValueError("no numbers")
    return said, arrays

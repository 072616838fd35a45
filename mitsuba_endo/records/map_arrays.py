"""What files of maps hold, whatever their makers call it, before it is judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, shown
from ..reading.npz import Arrays, open_npz, read_npy
from .exr_files import open_exr
from .map_convention import OPTION

CHANNELS = ("projector.x", "projector.y")
WEIGHT = "weight"
"""Optional further channel of an EXR file, or array of an npz file."""
COVARIANCE = "covariance"
"""Optional array (H, W, 3) of an npz file; of an EXR file the channels :data:`COVARIANCES`."""
COVARIANCES = ("covariance.xx", "covariance.xy", "covariance.yy")
CORRELATION = "correlation_px"
"""Optional number in an npz file, or attribute in an EXR file's header."""
PAIRS = {
    "projectorx": "projectory", "projx": "projy", "projectoru": "projectorv", "proju": "projv",
    "projectorcolumn": "projectorrow", "projectorcol": "projectorrow", "projcol": "projrow",
    "mapx": "mapy", "xmap": "ymap", "columnmap": "rowmap", "colmap": "rowmap", "x": "y", "u": "v",
    "qx": "qy", "column": "row", "columns": "rows", "col": "row", "cols": "rows",
}  # fmt: skip
"""Names of x and y in other tools' files, without capitals and underscores."""
_FORM = "store projector x and y as numbers, HxWx2"


@dataclass(frozen=True, eq=False)
class MapArrays:
    """What a file holds, before it is checked."""

    q: NDArray[np.float32]
    """(H, W, 2)"""
    weight: NDArray[np.float32] | None = None
    covariance: NDArray[np.float32] | None = None
    correlation_px: float | None = None


def read_map_exr(path: Path, channels: tuple[str, str] | None = None) -> MapArrays:
    """Read an OpenEXR file; coordinates may lie in any part and layer.

    Args:
        path: the file.
        channels: names of x and y; None: found.

    Raises:
        InputError: missing or damaged file, no coordinates, or several pairs.
    """
    file = open_exr(path)
    arrays = file.channels
    if file.lossy:
        todo = "write it without loss, e.g. with ZIP"
        raise InputError("is compressed with loss, which bends coordinates", str(path), todo)
    names = channels or find_pair(list(arrays), str(path))
    q = _stacked(arrays, names, str(path))
    given = any(name in arrays for name in COVARIANCES)
    covariance = _stacked(arrays, COVARIANCES, str(path)) if given else None
    return MapArrays(q, arrays.get(WEIGHT), covariance, file.numbers.get(CORRELATION))


def read_map_npz(path: Path, channels: tuple[str, str] | None = None) -> MapArrays:
    """Read an npz file: an array ``map`` or the only one, HxWx2 or 2xHxW, or two of x and y.

    Args:
        path: the file.
        channels: names of x and y; None: found.

    Raises:
        InputError: missing or damaged file, no coordinates, or several candidates.
    """
    with open_npz(path) as arrays:
        q = _coordinates(arrays, channels)
        weight, covariance = (
            arrays.get(name).astype(np.float32) if name in arrays else None
            for name in (WEIGHT, COVARIANCE)
        )
        correlation = float(arrays.get(CORRELATION, ())) if CORRELATION in arrays else None
    return MapArrays(q, weight, covariance, correlation)


def read_map_npy(path: Path, channels: tuple[str, str] | None = None) -> MapArrays:
    """Read the array of an npy file, HxWx2 or 2xHxW.

    Raises:
        InputError: missing or damaged file, another form, or names of channels, which it has not.
    """
    if channels:
        raise InputError("an npy file has no names", OPTION, "leave out channels=")
    return MapArrays(as_pairs(read_npy(path), "the array", str(path)))


READERS = {".exr": read_map_exr, ".npz": read_map_npz, ".npy": read_map_npy}
"""By suffix."""


def as_pairs(array: NDArray[Any], name: str, source: str) -> NDArray[np.float32]:
    """Return an array of coordinates, HxWx2 or 2xHxW, as (H, W, 2) float32.

    Raises:
        InputError: another form, or numbers of 8 bits.
    """
    if array.ndim == 3 and array.shape[0] == 2 and array.shape[2] != 2:
        array = np.moveaxis(array, 0, -1)
    if array.ndim != 3 or array.shape[2] != 2 or array.dtype.kind not in "fiu":
        form = "x".join(map(str, array.shape)) or "a single value"
        raise InputError(f"{name} is {array.dtype} {form}", source, _FORM)
    if array.dtype.kind in "iu" and array.dtype.itemsize == 1:
        todo = "store pattern pixels with 16 bits or more"
        raise InputError(f"{name} is {array.dtype}, too small for pattern pixels", source, todo)
    with np.errstate(over="ignore"):  # what single precision cannot hold is no coordinate
        return np.ascontiguousarray(array, np.float32)


def find_pair(names: Sequence[str], source: str) -> tuple[str, str]:
    """Return the names of x and y among names, which may have layers before them.

    Raises:
        InputError: there is no such pair, or several.
    """
    if set(CHANNELS) <= set(names):
        return CHANNELS
    pairs = {pair: kind for name in names for pair, kind in _pairs(name, names)}
    own = [pair for pair, kind in pairs.items() if kind == "projectorx"]
    choice = own if own else list(pairs)
    if len(choice) == 1:
        return choice[0]
    state = f"state {OPTION} channels=X/Y"
    if choice:
        told = ", ".join("/".join(pair) for pair in choice[:4])
        raise InputError(f"several pairs may be projector x and y: {told}", source, state)
    missing = next((name for name in CHANNELS if name not in names), CHANNELS[0])
    raise InputError(
        f"channel {missing} is missing among {shown(', '.join(names))}", source,
        f"name them {' and '.join(CHANNELS)}, or {state}",
    )  # fmt: skip


def _pairs(name: str, names: Sequence[str]) -> list[tuple[tuple[str, str], str]]:
    """Return the pairs that a name may be the x of, with what they are called."""
    parts = name.split(".")
    pairs = []
    for count in (1, 2):
        layer, kind = parts[:-count], _plain("".join(parts[-count:]))
        partners = [
            other for other in names
            if other.split(".")[:-count] == layer
            and _plain("".join(other.split(".")[-count:])) == PAIRS.get(kind)
        ]  # fmt: skip
        # Three are a vector of space: a normal, a position.
        vector = kind[-1:] == "x" and any(_plain(o) == f"{_plain(name)[:-1]}z" for o in names)
        if len(partners) == 1 and not vector:
            pairs.append(((name, partners[0]), kind))
    return pairs


def _plain(name: str) -> str:
    return "".join(c for c in name.lower() if c.isalnum())


def _stacked(
    channels: dict[str, NDArray[np.float32]], names: Sequence[str], source: str
) -> NDArray[np.float32]:
    """Return channels (H, W, n).

    Raises:
        InputError: one is missing, or they differ in size.
    """
    for name in names:
        if name not in channels:
            todo = f"name them {' and '.join(names)}"
            raise InputError(f"channel {name} is missing", source, todo)
        if channels[name].shape != channels[names[0]].shape:
            raise InputError(f"{name} and {names[0]} differ in size", source, "store one size")
    return np.stack([channels[name] for name in names], -1)


def _coordinates(arrays: Arrays, channels: tuple[str, str] | None) -> NDArray[np.float32]:
    kinds = "fiubcU"
    one = [name for name in arrays.names if name not in (WEIGHT, COVARIANCE, CORRELATION)]
    if channels is None and ("map" in arrays or len(one) == 1):
        name = "map" if "map" in arrays else one[0]
        return as_pairs(arrays.get(name, kinds=kinds), f"array '{name}'", arrays.source)
    planes = {name: arrays.get(name, kinds=kinds) for name in channels or ()}
    if channels is None:
        planes = {name: arrays.get(name, kinds=kinds) for name in one}
        planes = {name: array for name, array in planes.items() if array.ndim == 2}
        if not any(_pairs(name, list(planes)) for name in planes):
            todo = f"save it as map=HxWx2, or state {OPTION} channels=X/Y"
            what = f"array 'map' is missing among {shown(', '.join(arrays.names))}"
            raise InputError(what, arrays.source, todo)
    names = channels or find_pair(list(planes), arrays.source)
    chosen = [planes[name] for name in names]
    if len({array.shape for array in chosen}) > 1:
        raise InputError(f"{' and '.join(names)} differ in size", arrays.source, "store one size")
    return as_pairs(np.stack(chosen, -1), " and ".join(names), arrays.source)

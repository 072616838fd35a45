"""Correspondence maps: for each camera pixel the projector coordinate it sees."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..reading.exr_header import check_exr
from ..reading.npz import open_npz
from ..reading.quiet import quiet
from ..reading.regular import MAP, regular

CHANNELS = ("projector.x", "projector.y")
WEIGHT = "weight"
"""Optional further channel of an EXR file, or array of an npz file."""
SUFFIXES = (".exr", ".npz")


@dataclass(frozen=True, eq=False)
class CorrespondenceMap:
    """Observed projector coordinates of one frame."""

    q: NDArray[np.float32]
    """(H, W, 2) pattern pixels (x, y), integer = pixel centre, NaN = missing."""
    name: str
    """How the frame is called in results, usually its file name."""
    weight: NDArray[np.float32] | None = None
    """(H, W) how well each coordinate is known: 1 / variance up to a factor that all frames share;
    in files relative to the best, in (0, 1]. None: all alike."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) pixels that have a correspondence."""
        return np.isfinite(self.q[..., 0]) & np.isfinite(self.q[..., 1])


def load_map(path: str | Path) -> CorrespondenceMap:
    """Read a map from OpenEXR (channels projector.x, projector.y) or npz (array ``map``).

    A channel or array ``weight`` is optional; where it is not above zero, nothing is known.

    Raises:
        InputError: missing file, missing channels, wrong shape, nothing finite, wrong units.
    """
    path = Path(path)
    regular(path, MAP)
    check_map_path(path)
    q, weight = _read_exr(path) if path.suffix.lower() == ".exr" else _read_npz(path)
    known = np.asarray(np.isfinite(q).all(-1))
    if weight is not None:
        _check_weight(weight, q, str(path))
        known &= weight > 0
    q = np.where(known[..., None], q, np.float32(np.nan))
    _check(q, str(path))
    return CorrespondenceMap(q, path.name, weight)


def save_map(
    path: str | Path,
    q: NDArray[np.floating],
    further: dict[str, NDArray[np.floating]] | None = None,
) -> None:
    """Write an (H, W, 2) map as OpenEXR or npz, by the suffix of ``path``.

    Args:
        path: .exr or .npz.
        q: pattern pixels, NaN = missing.
        further: more channels (H, W) by name, e.g. ``weight``, see :class:`CorrespondenceMap`.

    Raises:
        InputError: another suffix, or the folder cannot be written.
    """
    check_map_path(Path(path))
    q = np.ascontiguousarray(q, dtype=np.float32)
    if Path(path).suffix.lower() == ".npz":
        # An open file, because NumPy appends its own suffix to names that end in .NPZ.
        with atomic_path(path) as aside, aside.open("wb") as file:
            arrays: dict[str, Any] = {"map": q, **(further or {})}
            np.savez_compressed(file, **arrays)
        return
    write_exr(path, {name: q[..., i] for i, name in enumerate(CHANNELS)} | (further or {}))


def write_exr(path: str | Path, channels: dict[str, NDArray[np.floating]]) -> None:
    """Write (H, W) channels as a float32 OpenEXR file.

    Raises:
        InputError: the file cannot be written.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    arrays = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in channels.items()}
    with atomic_path(path) as aside:
        try:
            OpenEXR.File(header, arrays).write(str(aside))
        except RuntimeError as error:  # how OpenEXR reports a full disk
            raise OSError(str(error)) from error


def read_exr(path: str | Path) -> dict[str, NDArray[np.float32]]:
    """Read every channel of an OpenEXR file as (H, W) float32.

    Raises:
        InputError: missing or damaged file.
    """
    check_exr(path)
    try:
        with quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
            return {k: np.array(c.pixels, np.float32) for k, c in file.channels().items()}
    except (RuntimeError, ValueError, TypeError, MemoryError):
        raise InputError("is not a readable OpenEXR file", str(path), "make it again") from None


def check_map_path(path: Path) -> None:
    """Refuse, before any work is done, a path that is not that of a map.

    Raises:
        InputError: a suffix other than .exr and .npz.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"unknown kind of map '{path.suffix}'", str(path), "give an .exr or .npz file"
        )


_Read = tuple[NDArray[np.float32], NDArray[np.float32] | None]
"""Coordinates (H, W, 2) and, if the file has them, weights."""


def _read_exr(path: Path) -> _Read:
    channels = read_exr(path)
    missing = [name for name in CHANNELS if name not in channels]
    if missing:
        raise InputError(
            f"channel {missing[0]} is missing", str(path), f"name them {' and '.join(CHANNELS)}"
        )
    return np.stack([channels[name] for name in CHANNELS], -1), channels.get(WEIGHT)


def _read_npz(path: Path) -> _Read:
    with open_npz(path) as arrays:
        if "map" not in arrays:
            raise InputError("array 'map' is missing", str(path), "save it as map=HxWx2")
        q = arrays.get("map", kinds="fiubcU")
        weight = arrays.get(WEIGHT).astype(np.float32) if WEIGHT in arrays else None
    if q.ndim != 3 or q.shape[2] != 2 or q.dtype.kind not in "fiu":
        raise InputError(
            f"array 'map' is {q.dtype} {'x'.join(map(str, q.shape))}", str(path),
            "store projector x and y as numbers, HxWx2",
        )  # fmt: skip
    with np.errstate(over="ignore"):  # what single precision cannot hold is no coordinate
        return q.astype(np.float32), weight


def _check_weight(weight: NDArray[np.float32], q: NDArray[np.float32], source: str) -> None:
    if weight.shape != q.shape[:2]:
        raise InputError(
            f"weight has shape {weight.shape} and the map {q.shape[:2]}", source,
            "give one weight for each pixel",
        )  # fmt: skip
    known = weight[~np.isnan(weight)]
    if known.size and not (known.min() >= 0 and known.max() <= 1):
        raise InputError(
            f"weights reach from {known.min():g} to {known.max():g}", source,
            "divide 1 / variance by its largest value, so that weights lie between 0 and 1",
        )  # fmt: skip


def _check(q: NDArray[np.float32], source: str) -> None:
    finite = q[np.isfinite(q).all(-1)]
    if not len(finite):
        raise InputError("the map has no finite value", source, "check how it was decoded")
    if finite.min() >= 0 and finite.max() <= 1:
        raise InputError(
            "all projector coordinates lie between 0 and 1", source,
            "give them in pattern pixels, not normalised",
        )  # fmt: skip

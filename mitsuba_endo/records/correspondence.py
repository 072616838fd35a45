"""Correspondence maps: for each camera pixel the projector coordinate it sees."""

from collections import Counter
from collections.abc import Sequence
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
COVARIANCE = "covariance"
"""Optional array (H, W, 3) of an npz file; of an EXR file the channels :data:`COVARIANCES`."""
COVARIANCES = ("covariance.xx", "covariance.xy", "covariance.yy")
CORRELATION = "correlation_px"
"""Optional number in an npz file, or attribute in an EXR file's header."""
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
    covariance: NDArray[np.float32] | None = None
    """(H, W, 3) xx, xy, yy of each coordinate's error, pattern pixels squared. None: not known."""
    correlation_px: float | None = None
    """Length L, camera pixels, over which errors are alike: those of pixels r apart correlate by
    exp(-r^2 / (2 L^2)), so that 2 pi L^2 pixels say as much as one. None: not known."""

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(H, W) pixels that have a correspondence."""
        return np.isfinite(self.q[..., 0]) & np.isfinite(self.q[..., 1])


def load_map(path: str | Path) -> CorrespondenceMap:
    """Read a map from OpenEXR (channels projector.x, projector.y) or npz (array ``map``).

    A channel or array ``weight`` is optional; where it is not above zero, nothing is known. So are
    covariances, as channels or array, and the length over which errors are alike. Covariances
    without weights give the weights.

    Raises:
        InputError: missing file, missing channels, wrong shape, nothing finite, wrong units.
    """
    path = Path(path)
    regular(path, MAP)
    check_map_path(path)
    read = _read_exr(path) if path.suffix.lower() == ".exr" else _read_npz(path)
    q, weight, covariance = read.q, read.weight, read.covariance
    known = np.asarray(np.isfinite(q).all(-1))
    if covariance is not None:
        check_covariance(covariance, q, str(path))
        known &= np.isfinite(covariance).all(-1)
        weight = relative_weight(covariance) if weight is None else weight
    if weight is not None:
        _check_weight(weight, q, str(path))
        known &= weight > 0
    _check_correlation(read.correlation_px, str(path))
    q = np.where(known[..., None], q, np.float32(np.nan))
    _check(q, str(path))
    return CorrespondenceMap(q, path.name, weight, covariance, read.correlation_px)


def frame_names(paths: Sequence[Path]) -> list[str]:
    """Return what frames of map files are called: files of one name by their folders too."""
    count = Counter(path.name for path in paths)
    return [
        f"{path.absolute().parent.name}/{path.name}" if count[path.name] > 1 else path.name
        for path in paths
    ]


def relative_weight(covariance: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return 1 / mean variance (H, W), relative to the best, of (H, W, 3); NaN gives 0."""
    variance = (covariance[..., 0] + covariance[..., 2]) / 2
    known = np.isfinite(variance)
    if not known.any():
        return np.zeros(variance.shape, np.float32)
    best = np.min(variance[known])
    weight = np.where(known, best / np.where(known, variance, 1), 0)
    return np.asarray(weight, np.float32)


def write_map(
    path: str | Path,
    map_: CorrespondenceMap,
    further: dict[str, NDArray[np.floating]] | None = None,
) -> None:
    """Write a map with all that is known of its errors; arguments as for :func:`save_map`.

    Raises:
        InputError: another suffix, or the folder cannot be written.
    """
    arrays = dict(further or {})
    if map_.weight is not None:
        arrays[WEIGHT] = map_.weight
    if map_.covariance is not None:
        if Path(path).suffix.lower() == ".npz":
            arrays[COVARIANCE] = map_.covariance
        else:
            arrays |= {name: map_.covariance[..., i] for i, name in enumerate(COVARIANCES)}
    save_map(path, map_.q, arrays, map_.correlation_px)


def save_map(
    path: str | Path,
    q: NDArray[np.floating],
    further: dict[str, NDArray[np.floating]] | None = None,
    correlation_px: float | None = None,
) -> None:
    """Write an (H, W, 2) map as OpenEXR or npz, by the suffix of ``path``.

    Args:
        path: .exr or .npz.
        q: pattern pixels, NaN = missing.
        further: more channels (H, W) by name, e.g. ``weight``, see :class:`CorrespondenceMap`.
        correlation_px: length over which errors are alike, camera pixels, if it is known.

    Raises:
        InputError: another suffix, or the folder cannot be written.
    """
    check_map_path(Path(path))
    q = np.ascontiguousarray(q, dtype=np.float32)
    numbers = {} if correlation_px is None else {CORRELATION: float(correlation_px)}
    if Path(path).suffix.lower() == ".npz":
        # An open file, because NumPy appends its own suffix to names that end in .NPZ.
        with atomic_path(path) as aside, aside.open("wb") as file:
            arrays: dict[str, Any] = {"map": q, **(further or {}), **numbers}
            np.savez_compressed(file, **arrays)
        return
    write_exr(path, {name: q[..., i] for i, name in enumerate(CHANNELS)} | (further or {}), numbers)


def write_exr(
    path: str | Path,
    channels: dict[str, NDArray[np.floating]],
    attributes: dict[str, float] | None = None,
) -> None:
    """Write (H, W) channels as a float32 OpenEXR file, with numbers in its header.

    Raises:
        InputError: the file cannot be written.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    arrays = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in channels.items()}
    with atomic_path(path) as aside:
        try:
            OpenEXR.File(header | (attributes or {}), arrays).write(str(aside))
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


@dataclass(frozen=True, eq=False)
class _Read:
    """What a file holds, before it is checked."""

    q: NDArray[np.float32]
    weight: NDArray[np.float32] | None
    covariance: NDArray[np.float32] | None
    correlation_px: float | None


def _read_exr(path: Path) -> _Read:
    channels = read_exr(path)
    given = [name for name in COVARIANCES if name in channels]
    wanted = CHANNELS + (COVARIANCES if given else ())
    missing = [name for name in wanted if name not in channels]
    if missing:
        raise InputError(
            f"channel {missing[0]} is missing", str(path), f"name them {' and '.join(wanted)}"
        )
    q = np.stack([channels[name] for name in CHANNELS], -1)
    covariance = np.stack([channels[name] for name in COVARIANCES], -1) if given else None
    with quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
        found = file.header().get(CORRELATION)
    correlation = float(found) if isinstance(found, (int, float)) else None
    return _Read(q, channels.get(WEIGHT), covariance, correlation)


def _read_npz(path: Path) -> _Read:
    with open_npz(path) as arrays:
        if "map" not in arrays:
            raise InputError("array 'map' is missing", str(path), "save it as map=HxWx2")
        q = arrays.get("map", kinds="fiubcU")
        weight, covariance = (
            arrays.get(name).astype(np.float32) if name in arrays else None
            for name in (WEIGHT, COVARIANCE)
        )
        correlation = float(arrays.get(CORRELATION, ())) if CORRELATION in arrays else None
    if q.ndim != 3 or q.shape[2] != 2 or q.dtype.kind not in "fiu":
        raise InputError(
            f"array 'map' is {q.dtype} {'x'.join(map(str, q.shape))}", str(path),
            "store projector x and y as numbers, HxWx2",
        )  # fmt: skip
    with np.errstate(over="ignore"):  # what single precision cannot hold is no coordinate
        return _Read(q.astype(np.float32), weight, covariance, correlation)


def check_covariance(
    covariance: NDArray[np.floating], q: NDArray[np.floating], source: str
) -> None:
    """Refuse covariances (H, W, 3) of a map (H, W, 2) that are none; NaN is passed over.

    Raises:
        InputError: another shape, or a covariance that is not positive; names ``source``.
    """
    if covariance.shape != (*q.shape[:2], 3):
        raise InputError(
            f"covariance has shape {covariance.shape} and the map {q.shape[:2]}", source,
            "give xx, xy and yy for each pixel",
        )  # fmt: skip
    xx, xy, yy = covariance[np.isfinite(covariance).all(-1)].T
    if not ((xx > 0) & (yy > 0) & (xy * xy <= xx * yy)).all():
        raise InputError(
            "holds a covariance that is not positive", source,
            "give variances above zero, and NaN where nothing is known",
        )  # fmt: skip


def _check_correlation(length: float | None, source: str) -> None:
    if length is not None and not (np.isfinite(length) and length >= 0):
        raise InputError(f"{CORRELATION} is {length:g}", source, "give a length in camera pixels")


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

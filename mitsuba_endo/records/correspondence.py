"""Correspondence maps: for each camera pixel the projector coordinate it sees."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..reading.regular import MAP, regular
from .exr_files import write_exr
from .map_arrays import CHANNELS, CORRELATION, COVARIANCE, COVARIANCES, READERS, WEIGHT
from .map_convention import AS_STORED, OPTION, MapConvention, Size

SUFFIXES = (".exr", ".npz")
"""Of maps that are written."""
READABLE = tuple(READERS)
"""Of maps that are read."""


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


def load_map(
    path: str | Path, convention: MapConvention = AS_STORED, size: Size | None = None
) -> CorrespondenceMap:
    """Read a map from OpenEXR (channels projector.x, projector.y), npz (array ``map``) or npy.

    A channel or array ``weight`` is optional; where it is not above zero, nothing is known. So are
    covariances, as channels or array, and the length over which errors are alike. Covariances
    without weights give the weights.

    Args:
        path: the file.
        convention: how its maker counts and orders coordinates.
        size: of the pattern, where the convention depends on it.

    Raises:
        InputError: missing file, missing channels, wrong shape, nothing finite, wrong units.
    """
    path = Path(path)
    regular(path, MAP)
    check_map_path(path, READABLE)
    read = READERS[path.suffix.lower()](path, convention.channels)
    q, covariance = convention.coordinates(read.q, size), read.covariance
    weight = None if read.weight is None else convention.upright(read.weight)
    valid = np.asarray(np.isfinite(q).all(-1))
    if covariance is not None:
        check_covariance(covariance, read.q, str(path))
        covariance = convention.covariance(covariance, size)
        valid &= np.isfinite(covariance).all(-1)
        weight = relative_weight(covariance) if weight is None else weight
    if weight is not None:
        _check_weight(weight, q, str(path))
        valid &= weight > 0
    _check_correlation(read.correlation_px, str(path))
    q = np.where(valid[..., None], q, np.float32(np.nan))
    _check(q, str(path))
    return CorrespondenceMap(q, path.name, weight, covariance, read.correlation_px)


def load_maps(
    paths: Sequence[Path], convention: MapConvention = AS_STORED, size: Size | None = None
) -> list[CorrespondenceMap]:
    """Read maps, calling files of one name in several folders by folder and name.

    Raises:
        InputError: as :func:`load_map`.
    """
    named = zip(paths, frame_names(paths), strict=True)
    return [replace(load_map(path, convention, size), name=name) for path, name in named]


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
    finite = np.isfinite(variance)
    if not finite.any():
        return np.zeros(variance.shape, np.float32)
    best = np.min(variance[finite])
    weight = np.where(finite, best / np.where(finite, variance, 1), 0)
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


def check_map_path(path: Path, suffixes: Sequence[str] = SUFFIXES) -> None:
    """Refuse, before any work is done, a path that is not that of a map.

    Raises:
        InputError: another suffix than those given.
    """
    if path.suffix.lower() not in suffixes:
        kinds = f"{', '.join(suffixes[:-1])} or {suffixes[-1]}"
        raise InputError(f"unknown kind of map '{path.suffix}'", str(path), f"give an {kinds} file")


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
    given = weight[~np.isnan(weight)]
    if given.size and not (given.min() >= 0 and given.max() <= 1):
        raise InputError(
            f"weights reach from {given.min():g} to {given.max():g}", source,
            "divide 1 / variance by its largest value, so that weights lie between 0 and 1",
        )  # fmt: skip


def _check(q: NDArray[np.float32], source: str) -> None:
    finite = q[np.isfinite(q).all(-1)]
    if not len(finite):
        raise InputError("the map has no finite value", source, "check how it was decoded")
    if np.abs(finite).max() <= 1:
        low = "0" if finite.min() >= 0 else "-1"
        raise InputError(
            f"all projector coordinates lie between {low} and 1", source,
            f"give them in pattern pixels, or state {OPTION} normalised"
            + (",signed" if low == "-1" else ""),
        )  # fmt: skip

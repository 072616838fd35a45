"""A dataset as HDF5 shards: for training."""

import json
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..litter import sweep
from ..reading.regular import SHARD, regular
from ..reading.trees import parse_json
from . import contents
from .contents import Stored, numbered
from .digests import array_digest, file_digest, text_digest
from .hdf5_guard import BROKEN, texts_and_arrays
from .intact import TODO, check_arrays, checked_description
from .sample import Sample

STAGING = "staging"
SHARDS = "shards"
SUFFIX = ".h5"
DESCRIPTION, TRUTH = "sample.json", "truth.json"


def hdf5() -> Any:
    """Return the module h5py.

    Raises:
        InputError: it is not installed.
    """
    try:
        import h5py  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "HDF5 needs the package h5py", "format", 'pip install "mitsuba-endo[dataset]"'
        ) from None
    return h5py


class ShardStore:
    """``shards/000003.h5`` holds samples 3 n to 4 n - 1, one group each.

    Workers write samples into ``staging/``; when all samples of a shard are settled they are
    copied into it, and it appears complete. The same samples give the same bytes.
    """

    def __init__(self, folder: str | Path, per_shard: int) -> None:
        self._staging, self._shards = Path(folder) / STAGING, Path(folder) / SHARDS
        self._per_shard = per_shard

    def write(self, sample: Sample, radiance: bool, surface: bool) -> None:
        """Stage a sample: it appears complete or not at all.

        Raises:
            InputError: the folder cannot be written.
        """
        arrays = contents.arrays_of(sample, radiance, surface)
        with atomic_path(self._staged(sample.index)) as aside, hdf5().File(aside, "w") as file:
            group = file.create_group(_name(sample.index))
            for name, array in arrays.items():
                group.create_dataset(name, data=array, **_filters(name, array))
            group[TRUTH] = sample.truth.to_solution().model_dump_json(by_alias=True)
            sums = {name: array_digest(array) for name, array in arrays.items()}
            sums[TRUTH] = text_digest(group[TRUTH].asstr()[()])
            group[DESCRIPTION] = json.dumps({**sample.description, "sha256": sums})

    def indices(self) -> set[int]:
        """Return the numbers of the samples that are there, staged or in shards."""
        return numbered(self._staging, SUFFIX).union(*map(self._within, self._numbers()))

    def read(self, index: int) -> Stored:
        """Read a sample back.

        Raises:
            InputError: it is missing or damaged.
        """
        staged = self._staged(index)
        path = staged if staged.exists() else self._shard(index // self._per_shard)
        regular(path, SHARD, f"has no sample {index}", TODO)
        try:
            with hdf5().File(path, "r") as file:
                texts, arrays = texts_and_arrays(file[_name(index)], (DESCRIPTION, TRUTH))
        except BROKEN:
            raise InputError(f"has no readable sample {index}", str(path), TODO) from None
        where = f"{path}: {_name(index)}"
        described = checked_description(parse_json(texts[DESCRIPTION], where, TODO), where)
        sums = dict(described["sha256"])
        if sums.pop(TRUTH, None) != text_digest(texts[TRUTH]):
            raise InputError("truth is missing or damaged", where, TODO)
        check_arrays(arrays, sums, where)
        return Stored(described, arrays)

    def settle(self, settled: set[int], last: bool) -> None:
        """Seal the shards of which all samples are settled, or all if none follows."""
        staged = numbered(self._staging, SUFFIX)
        for number in sorted({index // self._per_shard for index in staged}):
            members = range(number * self._per_shard, (number + 1) * self._per_shard)
            if last or settled.issuperset(members):
                self._seal(number, sorted(staged.intersection(members)))

    def clear(self) -> None:
        """Remove what a killed process left half written, and staged copies of sealed samples."""
        for folder in (self._staging, self._shards):
            sweep(folder, alone=True)
        sealed = set().union(*map(self._within, self._numbers()))
        for index in numbered(self._staging, SUFFIX) & sealed:
            self._staged(index).unlink()

    def manifest(self) -> list[dict[str, Any]]:
        """Return every shard with its checksum and samples."""
        return [
            {
                "path": f"{SHARDS}/{self._shard(number).name}",
                "sha256": file_digest(self._shard(number)),
                "samples": sorted(self._within(number)),
            }
            for number in sorted(self._numbers())
        ]

    def _seal(self, number: int, staged: list[int]) -> None:
        """Write a shard from what it already holds and the staged samples, then remove these."""
        h5py, path = hdf5(), self._shard(number)
        held = self._within(number)
        with atomic_path(path) as aside, h5py.File(aside, "w") as file:
            for index in sorted({*held, *staged}):
                source = self._staged(index) if index in staged else path
                with h5py.File(source, "r") as old:
                    old.copy(old[_name(index)], file, _name(index))
        for index in staged:
            self._staged(index).unlink()
        if not any(self._staging.iterdir()):
            self._staging.rmdir()

    def _numbers(self) -> set[int]:
        return numbered(self._shards, SUFFIX)

    def _within(self, number: int) -> set[int]:
        """Return the samples in a shard.

        Raises:
            InputError: it cannot be read.
        """
        path = self._shard(number)
        if not path.exists():
            return set()
        regular(path, SHARD)
        try:
            with hdf5().File(path, "r") as file:
                return {int(name) for name in file if name.isascii() and name.isdigit()}
        except BROKEN:
            raise InputError(
                "is damaged", str(path), "remove it: its samples are made again"
            ) from None

    def _staged(self, index: int) -> Path:
        return self._staging / f"{_name(index)}{SUFFIX}"

    def _shard(self, number: int) -> Path:
        return self._shards / f"{number:06d}{SUFFIX}"


def _filters(name: str, array: NDArray[Any]) -> dict[str, Any]:
    """Return how an array is compressed: masks, nodes and faces shrink to a tenth.

    Photographs and floating-point maps would shrink by a quarter, and take ten times as long to
    write as everything else.
    """
    if name == contents.IMAGE or array.dtype.kind == "f":
        return {}
    # One chunk: a sample is read as a whole. Not the faster lzf, whose output depends on what its
    # memory held before.
    return {"chunks": array.shape, "compression": "gzip", "compression_opts": 1, "shuffle": True}


def _name(index: int) -> str:
    return f"{index:06d}"

"""A file of arrays that is not as it was written is refused, sound as it may be for its container.

Oracle: what is changed, array by array.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.reading.npz import open_npz
from mitsuba_endo.records.sealed_arrays import SEAL, check_seal, seal_of

ARRAYS: dict[str, NDArray] = {
    "a": np.arange(6.0).reshape(2, 3), "b": np.array(["x", "yy"]), "c": np.array(3),
    "d": np.zeros((0, 2), bool),
}  # fmt: skip
CHANGES: dict[str, Callable[[dict[str, NDArray]], object]] = {
    "taken away": lambda arrays: arrays.pop("d"),
    "added": lambda arrays: arrays.update(e=np.zeros(1)),
    "renamed": lambda arrays: arrays.update(e=arrays.pop("c")),
    "exchanged": lambda arrays: arrays.update(a=arrays["c"], c=arrays["a"]),
    "another shape": lambda arrays: arrays.update(a=arrays["a"].reshape(3, 2)),
    "another type": lambda arrays: arrays.update(c=arrays["c"].astype(np.uint64)),
    "one number": lambda arrays: arrays.update(a=np.where(arrays["a"] == 3, np.nan, arrays["a"])),
    "one letter": lambda arrays: arrays.update(b=np.array(["x", "yz"])),
    "another seal": lambda arrays: arrays.update({SEAL: np.zeros(16, np.uint8)}),
    "no seal": lambda arrays: arrays.pop(SEAL),
}


def _check(path: Path, arrays: dict[str, NDArray]) -> None:
    np.savez(path, **arrays)
    with open_npz(path) as data:
        check_seal(data, "make it again")


def test_as_written_in_any_order(tmp_path: Path):
    sealed = ARRAYS | {SEAL: seal_of(ARRAYS.items())}
    _check(tmp_path / "a.npz", sealed)
    _check(tmp_path / "b.npz", dict(reversed(sealed.items())))


@pytest.mark.parametrize("how", CHANGES)
def test_changed(tmp_path: Path, how: str):
    arrays = ARRAYS | {SEAL: seal_of(ARRAYS.items())}
    CHANGES[how](arrays)
    with pytest.raises(InputError, match=r"checksum differs|'seal' is missing"):
        _check(tmp_path / "a.npz", arrays)

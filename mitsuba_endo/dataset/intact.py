"""Whether what is read of a dataset is what was written."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field

from ..errors import InputError
from ..records.validation import Real, validate
from .contents import Arrays
from .digests import array_digest, file_digest

TODO = "remove it: it is made again by the command that made it"


class _Polyp(BaseModel):
    diameter: Real


class _Description(BaseModel):
    """What of a sample's description others rely on; there is more in it."""

    index: int
    kind: str
    polyps: list[_Polyp]
    sha256: dict[Annotated[str, Field(pattern=r"^[\w.]+$")], str]


def checked_description(data: dict[str, Any], source: str) -> dict[str, Any]:
    """Return a sample's description if what others rely on is in it.

    Raises:
        InputError: it is not; names the field.
    """
    validate(_Description, data, source)
    return data


def check_files(folder: Path, sums: dict[str, str]) -> None:
    """Compare the files of a sample with their checksums.

    Raises:
        InputError: one is missing or differs.
    """
    for name, digest in sums.items():
        path = folder / name
        try:
            same = file_digest(path) == digest
        except OSError:
            same = False
        if not same:
            todo = f"remove {folder}: it is made again"
            raise InputError("is missing or damaged", str(path), todo)


def check_arrays(arrays: Arrays, sums: dict[str, str], source: str) -> None:
    """Compare the arrays of a sample with their checksums.

    Raises:
        InputError: one is missing or differs.
    """
    for name, digest in sums.items():
        if name not in arrays or array_digest(arrays[name]) != digest:
            raise InputError(f"array {name} is missing or damaged", source, TODO)

"""What comes back from a dataset, in whatever format it is stored."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from .contents import Arrays
from .sample import Sample


@dataclass(frozen=True, eq=False)
class Stored:
    """A sample read from disk."""

    description: dict[str, Any]
    """Contents of ``sample.json``."""
    arrays: Arrays
    """By the names of :mod:`.contents`."""


class Store(Protocol):
    """A place for samples, in one format."""

    def write(self, sample: Sample, radiance: bool, surface: bool) -> None:
        """Write a sample, complete or not at all; called by any worker."""
        ...

    def indices(self) -> set[int]:
        """Return the numbers of the samples that are there."""
        ...

    def read(self, index: int) -> Stored:
        """Read a sample back."""
        ...

    def settle(self, settled: set[int], last: bool) -> None:
        """Tidy up, given the numbers that are done or have failed, and whether none follows."""
        ...

    def clear(self) -> None:
        """Remove what a killed process left half written."""
        ...

    def manifest(self) -> list[dict[str, Any]]:
        """Return what is there, with checksums."""
        ...


def numbered(folder: Path, suffix: str) -> set[int]:
    """Return the numbers in the names of a folder's entries such as ``000012.json``."""
    if not folder.is_dir():
        return set()
    form = re.compile(r"(\d{6,})" + re.escape(suffix))
    matches = (form.fullmatch(path.name) for path in folder.iterdir())
    return {int(match[1]) for match in matches if match}

"""What is stored of a sample, under the names it has in every format, and what stores it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .sample import Sample

Arrays = dict[str, NDArray[Any]]

IMAGE, RADIANCE, Q, PHASE, NODE, CODE = "image", "radiance", "q", "phase", "node", "code"
DEPTH, NORMALS, VERTICES, FACES = "depth", "normals", "vertices", "faces"
MASKS = ("visible", "shadow", "camera", "mixed")


def arrays_of(sample: Sample, radiance: bool, surface: bool) -> Arrays:
    """Return a sample's arrays by name; see :class:`~.truth.TruthMaps` for their meaning.

    Args:
        sample: the sample.
        radiance: whether to keep the linear image, float16.
        surface: whether to keep the mesh: ``vertices`` (mm, camera frame) and ``faces``.
    """
    maps = sample.maps
    arrays: Arrays = {
        IMAGE: sample.image, Q: maps.q, PHASE: maps.phase, NODE: maps.node, CODE: maps.code,
        DEPTH: maps.depth, NORMALS: maps.normals,
        **{name: getattr(maps, name) for name in MASKS},
    }  # fmt: skip
    if radiance:
        arrays[RADIANCE] = sample.radiance
    if surface:
        arrays[VERTICES] = sample.mesh.vertices.astype(np.float32)
        arrays[FACES] = sample.mesh.faces.astype(np.uint32)
    return arrays


@dataclass(frozen=True, eq=False)
class Stored:
    """A sample read from disk."""

    description: dict[str, Any]
    """Contents of ``sample.json``."""
    arrays: Arrays
    """By the names above."""


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
    pattern = re.compile(r"(\d{6,})" + re.escape(suffix))
    matches = (pattern.fullmatch(path.name) for path in folder.iterdir())
    return {int(match[1]) for match in matches if match}

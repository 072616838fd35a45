"""A dataset as a folder of files a sample: for people, and for the other commands."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.image_files import read_image
from ..errors import InputError
from ..files import atomic_folder
from ..folder_mark import Kind
from ..litter import sweep
from ..reading.trees import read_json
from ..records.calibration import SurfaceEstimate
from ..records.correspondence import save_map
from ..records.exr_files import read_exr, write_exr
from ..records.ground_truth import save_truth
from ..records.known_input import known_rig, save_rig
from ..records.surface import load_surface, save_surface
from . import contents
from .contents import Arrays, Stored, numbered
from .digests import file_digest
from .intact import TODO, check_files, checked_description
from .sample import MAP, Sample

SAMPLES = "samples"
DESCRIPTION = "sample.json"
SURFACE = "truth_surface.ply"
TRUTH = "truth.json"
# The names within a sample's folder are those of `mitsuba-endo render`.
CHANNELS = {
    "image.exr": (contents.RADIANCE, ("R", "G", "B")),
    "projector.exr": (contents.Q, ("projector.x", "projector.y")),
    "depth.exr": (contents.DEPTH, ("Z",)),
    "normals.exr": (contents.NORMALS, ("normal.x", "normal.y", "normal.z")),
}
GRID = "grid.exr"
GRID_CHANNELS = {
    contents.PHASE: ("phase.x", "phase.y"),
    contents.NODE: ("node.x", "node.y"),
    contents.CODE: ("code",),
}
MASKS = "masks.exr"
TYPES = {contents.RADIANCE: np.float16, contents.NODE: np.int16, contents.CODE: np.int8}


class FolderStore:
    """``samples/000012/`` and so on: each absent or complete."""

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder) / SAMPLES

    def write(self, sample: Sample, radiance: bool, surface: bool) -> None:
        """Write a sample: it appears complete or not at all.

        Raises:
            InputError: the folder cannot be written.
        """
        arrays = contents.arrays_of(sample, radiance, surface)
        with atomic_folder(self._path(sample.index), Kind.SAMPLE) as folder:
            _write_image(folder / "image.png", arrays[contents.IMAGE])
            save_map(folder / MAP, sample.maps.correspondences())
            for name, (array, channels) in CHANNELS.items():
                if array in arrays:
                    write_exr(folder / name, _split(arrays[array], channels))
            grid = [_split(arrays[array], names) for array, names in GRID_CHANNELS.items()]
            write_exr(folder / GRID, {k: v for part in grid for k, v in part.items()})
            write_exr(folder / MASKS, {name: arrays[name] for name in contents.MASKS})
            save_rig(folder / "rig.yaml", known_rig(sample.truth))
            save_truth(folder / TRUTH, replace(sample.truth, surface=SURFACE if surface else None))
            if surface:
                mesh = SurfaceEstimate(sample.mesh.vertices, sample.mesh.faces)
                save_surface(folder / SURFACE, mesh)
            sums = {p.name: file_digest(p) for p in sorted(folder.iterdir())}
            described = {**sample.description, "sha256": sums}
            (folder / DESCRIPTION).write_text(json.dumps(described, indent=1) + "\n", "utf-8")

    def indices(self) -> set[int]:
        """Return the numbers of the samples that are there."""
        return numbered(self._folder, "")

    def read(self, index: int) -> Stored:
        """Read a sample back.

        Raises:
            InputError: a file of it is missing or damaged.
        """
        folder = self._path(index)
        description = self._described(folder)
        check_files(folder, description["sha256"])
        arrays: Arrays = {contents.IMAGE: _read_image(folder / "image.png")}
        for name, (array, channels) in CHANNELS.items():
            if (folder / name).exists():
                arrays[array] = _joined(read_exr(folder / name), channels, str(folder))
        grid = read_exr(folder / GRID)
        arrays |= {
            array: _joined(grid, names, str(folder)) for array, names in GRID_CHANNELS.items()
        }
        masks = read_exr(folder / MASKS)
        arrays |= {n: _joined(masks, (n,), str(folder)) > 0 for n in contents.MASKS}
        for name, kind in TYPES.items():
            if name in arrays:
                arrays[name] = arrays[name].astype(kind)
        if (folder / SURFACE).exists():
            mesh = load_surface(folder / SURFACE)
            arrays[contents.VERTICES] = mesh.vertices.astype(np.float32)
            arrays[contents.FACES] = mesh.faces.astype(np.uint32)
        return Stored(description, arrays)

    def settle(self, settled: set[int], last: bool) -> None:
        """Do nothing: every sample is where it belongs as soon as it is written."""

    def clear(self) -> None:
        """Remove what a killed process left half written."""
        sweep(self._folder, alone=True)

    def manifest(self) -> list[dict[str, Any]]:
        """Return every sample's kind and files with their checksums."""
        listed = []
        for index in sorted(self.indices()):
            path = self._path(index)
            described = self._described(path)
            sums = {**described["sha256"], DESCRIPTION: file_digest(path / DESCRIPTION)}
            folder = f"{SAMPLES}/{path.name}"
            listed.append(
                {"index": index, "kind": described["kind"], "path": folder, "sha256": sums}
            )
        return listed

    def _described(self, folder: Path) -> dict[str, Any]:
        path = folder / DESCRIPTION
        return checked_description(read_json(path, TODO), str(path))

    def _path(self, index: int) -> Path:
        return self._folder / f"{index:06d}"


def _split(array: NDArray[Any], channels: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    stacked = array[..., None] if array.ndim == 2 else array
    return {name: stacked[..., i] for i, name in enumerate(channels)}


def _joined(
    channels: dict[str, NDArray[np.float32]], names: tuple[str, ...], source: str
) -> NDArray[Any]:
    missing = [name for name in names if name not in channels]
    if missing:
        raise InputError(f"channel {missing[0]} is missing", source, TODO)
    stacked = np.stack([channels[name] for name in names], -1)
    return stacked[..., 0] if len(names) == 1 else stacked


def _write_image(path: Path, image: NDArray[Any]) -> None:
    data = cv2.imencode(".png", image[..., ::-1] if image.ndim == 3 else image)[1]
    path.write_bytes(data.tobytes())


def _read_image(path: Path) -> NDArray[Any]:
    image = read_image(path)
    return image[..., 0] if image.shape[2] == 1 else np.ascontiguousarray(image[..., ::-1])

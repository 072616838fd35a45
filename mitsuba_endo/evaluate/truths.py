"""One truth or several: files, solution folders, folders of captures, other programs' files."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..decoding.image_files import natural_order
from ..errors import InputError
from ..reading.regular import exists, is_file
from ..records.calibration_files import read_calibration
from ..records.solution import Frame, Solution, solution_file
from .matching import MatchBy, Matched, match_names

Pair = tuple[Frame, Frame]
"""A frame of the solution and that of the truth."""

TRUTH = "truth.json"
_IMAGES = ("image.png",)
"""What a capture's photograph is called: a frame decoded from it is called after it."""
_ALIKE = 1e-9
"""Relative difference of intrinsics of one device: they are written with all digits."""


@dataclass(frozen=True, eq=False)
class Truths:
    """The truth of all frames, in one record."""

    record: Solution
    """Frames of all truths; ``surface`` is left out."""
    names: list[tuple[str, ...]]
    """What each frame may be called."""
    surfaces: list[Path | None]
    """File of the true surface that each frame was captured with."""
    owners: list[int]
    """Index of the frame in whose camera's frame that surface is given."""
    without_surface: str = "the truth has no surface"
    """Why there is none, where there is none."""

    def match(self, solution: Solution, by: MatchBy = "name") -> tuple[list[int], Matched]:
        """Return for every frame of a solution the index of the true one.

        Raises:
            InputError: frames that cannot be paired, or images of another size.
        """
        check_sizes(solution, self.record)
        return match_names([f.name for f in solution.frames], self.names, by)


def check_sizes(solution: Solution, truth: Solution) -> None:
    """Refuse a truth of images of another size.

    Raises:
        InputError: tells both sizes; a side without camera tells nothing.
    """
    sizes = [(c.width, c.height) for c in (solution.camera, truth.camera) if c is not None]
    if len(set(sizes)) > 1:
        here, there = ("{} x {}".format(*size) for size in sizes)
        raise InputError(
            f"images of {there} pixels, but the solution's are {here}", "truth: camera",
            "give the truth of the same capture",
        )  # fmt: skip


def check_apart(result: str | Path, truths: Sequence[str | Path]) -> None:
    """Refuse to compare a result with itself: every error would be zero.

    Raises:
        InputError: names the truth that is the result.
    """
    read = solution_file(result).resolve()
    for truth in truths:
        if solution_file(truth).resolve() == read:
            raise InputError(
                f"is the result itself ({read.name})", str(truth),
                "give another file, e.g. the truth.json that render wrote",
            )  # fmt: skip


def load_truths(paths: Sequence[str | Path]) -> Truths:
    """Read truths; a folder of captures stands for the truths in its folders, by number and name.

    Raises:
        InputError: none is given, one cannot be read, a folder holds none, or they are not of one
            camera and projector.
    """
    files = [file for path in paths for file in _truths_of(Path(path))]
    if not files:
        raise InputError("none is given", "truth", "give --truth")
    read = [
        truths_of(read_calibration(file)[0], file if file.is_dir() else file.parent, len(files) > 1)
        for file in files
    ]
    return read[0] if len(read) == 1 else _merged(read, [str(file) for file in files])


def truths_of(record: Solution, folder: str | Path | None, several: bool = False) -> Truths:
    """Return one truth that was read.

    Args:
        record: what was read.
        folder: of its surface; None: it is not known.
        several: whether the folder's name is part of the frames' names.
    """
    folder = None if folder is None else Path(folder)
    surface, why = None, "the truth has no surface"
    if record.surface is not None and folder is not None:
        surface = folder / record.surface
    elif record.surface is not None:
        why = "the folder of the truth's surface is not given"
    images = () if folder is None else tuple(n for n in _IMAGES if is_file(folder / n))
    names = [(f.name, *(images if len(record.frames) == 1 else ())) for f in record.frames]
    if several and folder is not None:
        names = [tuple(f"{folder.name}/{name}" for name in aliases) for aliases in names]
    frames = [
        f.model_copy(update={"name": aliases[0]})
        for f, aliases in zip(record.frames, names, strict=True)
    ]
    return Truths(
        record.model_copy(update={"frames": frames, "surface": None}), names,
        [surface] * len(frames), [0] * len(frames), why,
    )  # fmt: skip


def _truths_of(path: Path) -> list[Path]:
    """Return a path, or where it is a folder of captures those that have a truth."""
    if not path.is_dir() or exists(path / TRUTH) or exists(path / "solution.json"):
        return [path]
    inside = sorted((p.parent for p in path.glob(f"*/{TRUTH}")), key=natural_order)
    return inside or [path]


def _merged(truths: list[Truths], files: list[str]) -> Truths:
    """Join truths of one rig; focal lengths become those of the frames."""
    first = truths[0].record
    for truth, file in zip(truths[1:], files[1:], strict=True):
        _check_one_rig(first, truth.record, file)
    frames, names, surfaces, owners = [], [], [], []
    for truth in truths:
        owners += [len(frames) + k for k in truth.owners]
        focal = truth.record.projector.focal
        frames += [f.model_copy(update={"focal": f.focal or focal}) for f in truth.record.frames]
        names += truth.names
        surfaces += truth.surfaces
    return Truths(first.model_copy(update={"frames": frames}), names, surfaces, owners)


def _check_one_rig(first: Solution, other: Solution, file: str) -> None:
    if first.units != other.units:
        raise InputError(f"is in {other.units}, and the first in {first.units}", file,
                         "evaluate them one by one")  # fmt: skip
    if first.camera is not None and other.camera is not None and not _alike(
        first.camera.model_dump(), other.camera.model_dump()
    ):  # fmt: skip
        raise InputError("has another camera than the first truth", file,
                         "evaluate them one by one")  # fmt: skip
    values = [
        {name: getattr(p, name).value for name in ("centre", "aspect", "distortion")}
        | {"law": p.law, "size": [p.width, p.height]}
        for p in (first.projector, other.projector)
    ]
    if not _alike(*values):
        raise InputError("has another projector than the first truth", file,
                         "evaluate them one by one")  # fmt: skip


def _alike(a: Any, b: Any) -> bool:
    """Compare nested values, numbers by their relative difference."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_alike(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_alike(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float | int) and isinstance(b, float | int):
        return abs(a - b) <= _ALIKE * max(abs(a), abs(b))
    return a == b

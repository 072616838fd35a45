"""Frames of a sequence from files, one at a time: maps, images, folders of either, videos."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from ..decoding.image_files import ImageFrame, images_of, is_images, read_frames
from ..errors import InputError
from ..reading.regular import MAP, regular
from ..records.correspondence import SUFFIXES as MAPS
from ..records.correspondence import frame_names, load_map
from ..records.rig import Rig
from ..refine.image_decoder import ImageDecoder
from .frames import Incoming, Unread


@dataclass(frozen=True)
class Chosen:
    """Which frames of the input are used."""

    start: int = 0
    """The first, from 0."""
    end: int | None = None
    """The one after the last; None: all that follow."""
    stride: int = 1
    """Every so many."""


ALL = Chosen()


def frames_of(
    paths: Sequence[Path],
    rig: Rig,
    chosen: Chosen = ALL,
    pattern: str | None = None,
    *,
    refine: bool = True,
) -> tuple[Iterator[Incoming], int | None]:
    """Return the frames of files, and how many there are, if that is known beforehand.

    What is no map, or shows no pattern, is a frame without a map and says why.

    Args:
        paths: correspondence maps, or images of the coded grid and videos; folders of either.
        rig: size of image and pattern.
        chosen: which frames.
        pattern: in the images; None: the default one.
        refine: whether decoded coordinates are refined on the image.

    Raises:
        InputError: a file is missing, maps and images at once, options for images with maps, or
            no frame is left.
    """
    files = [file for path in paths for file in _inside(path)]
    maps = [file for file in files if file.suffix.lower() in MAPS]
    if maps and len(maps) < len(files):
        raise InputError("maps and images are given", str(maps[0]), "give one kind")
    if not maps:
        images = islice(read_frames(files), chosen.start, chosen.end, chosen.stride)
        return _decoded(images, rig, pattern, refine), None
    for name, given in (("--pattern", pattern is not None), ("--no-refine", not refine)):
        if given:
            raise InputError("is for images, and maps are given", name, "leave it out")
    for file in maps:
        regular(file, MAP)
    used = maps[chosen.start : chosen.end : chosen.stride]
    if not used:
        raise InputError(f"of {len(maps)} frames none is left", "--start", "choose an earlier one")
    return _loaded(used), len(used)


def _inside(path: Path) -> list[Path]:
    """Return the maps of a folder, or else its images; of anything else itself."""
    if not path.is_dir():
        if not is_images(path) and path.suffix.lower() not in MAPS:
            raise InputError(
                f"unknown kind of file '{path.suffix}'", str(path), "give maps, images or videos"
            )
        return [path]
    has_maps = any(p.suffix.lower() in MAPS for p in path.iterdir())
    return images_of(path, MAPS) if has_maps else [path]


def _loaded(files: Sequence[Path]) -> Iterator[Incoming]:
    for file, name in zip(files, frame_names(files), strict=True):
        try:
            yield replace(load_map(file), name=name)
        except InputError as error:
            yield Unread(name, error.what)


def _decoded(
    images: Iterator[ImageFrame], rig: Rig, pattern: str | None, refine: bool
) -> Iterator[Incoming]:
    decoder = ImageDecoder(rig, pattern, refine=refine)
    for frame in images:
        decoded = decoder.decode(frame)
        if decoded.grid.reason:
            yield Unread(frame.name, decoded.grid.reason)
        else:
            yield decoded.map.map

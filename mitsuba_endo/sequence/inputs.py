"""Frames of a sequence from files, one at a time: maps, images, folders of either, videos."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..decoding.image_files import ImageFrame, images_of, is_images, read_frames
from ..errors import InputError
from ..reading.regular import MAP, read_bytes, regular
from ..records.correspondence import SUFFIXES as MAPS
from ..records.correspondence import CorrespondenceMap, frame_names, load_map
from ..records.rig import Rig
from ..refine.image_decoder import ImageDecoder
from .frames import Incoming, PicturedMap, Unread
from .resume import Decoding, Past


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


@dataclass(eq=False)
class Feed:
    """Frames that come when they are asked for, one at a time."""

    _arriving: Iterator["Arrival"]
    count: int | None
    """Frames in all, those that were seen before included; None: not known before the end."""
    past: Sequence[str] = ()
    """Marks of frames that were seen before: they come first, and are passed over unread."""
    where: str = ""
    """Whose marks they are, for messages."""

    def __post_init__(self) -> None:
        self.marks = list(self.past)
        """Of the frames that have come so far."""

    def __iter__(self) -> Iterator[Incoming]:
        """Yield the new frames.

        Raises:
            InputError: the first ones are not those that were seen before.
        """
        seen = 0
        for arrival in self._arriving:
            if seen < len(self.past):
                self._check(seen, arrival)
                seen += 1
            else:
                self.marks.append(arrival.mark)
                yield arrival.frame()
        if seen < len(self.past):
            raise InputError(
                f"the sequence to go on with has {len(self.past)} frames, and {seen} are given",
                self.where, "give all of them again, and new ones after them",
            )  # fmt: skip

    def _check(self, number: int, arrival: "Arrival") -> None:
        was = self.past[number]
        if arrival.mark == was:
            return
        name = was.rpartition(" ")[0]
        how = "has changed since" if name == arrival.name else f"was {name} there"
        raise InputError(
            f"frame {number + 1} of the sequence to go on with {how}", arrival.name,
            "give the same frames in the same order, and new ones after them",
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Arrival:
    """A frame that has come, and was not read or decoded yet."""

    name: str
    digest: str
    """Of its contents."""
    frame: Callable[[], Incoming]

    @property
    def mark(self) -> str:
        """What tells it from other frames."""
        return f"{self.name} {self.digest}"


def frames_of(
    paths: Sequence[Path],
    rig: Rig,
    chosen: Chosen = ALL,
    pattern: str | None = None,
    *,
    refine: bool = True,
    past: Past | None = None,
) -> Feed:
    """Return the frames of files.

    What is no map, or shows no pattern, is a frame without a map and says why.

    Args:
        paths: correspondence maps, or images of the coded grid and videos; folders of either.
        rig: size of image and pattern.
        chosen: which frames.
        pattern: in the images; None: the default one.
        refine: whether decoded coordinates are refined on the image.
        past: an earlier run, whose frames are the first ones and are not read again.

    Raises:
        InputError: a file is missing, maps and images at once, options for images with maps, no
            frame is left, or the earlier run decoded otherwise.
    """
    files = [file for path in paths for file in _inside(path)]
    maps = [file for file in files if file.suffix.lower() in MAPS]
    if maps and len(maps) < len(files):
        raise InputError("maps and images are given", str(maps[0]), "give one kind")
    if past is not None:
        past.check_decoding(Decoding(pattern, refine))
    marks, where = (past.marks, past.where) if past else ([], "")
    if not maps:
        images = islice(read_frames(files), chosen.start, chosen.end, chosen.stride)
        return Feed(_decoded(images, rig, pattern, refine), None, marks, where)
    for name, given in (("--pattern", pattern is not None), ("--no-refine", not refine)):
        if given:
            raise InputError("is for images, and maps are given", name, "leave it out")
    for file in maps:
        regular(file, MAP)
    used = maps[chosen.start : chosen.end : chosen.stride]
    if not used:
        raise InputError(f"of {len(maps)} frames none is left", "--start", "choose an earlier one")
    return Feed(_loaded(used), len(used), marks, where)


def feed_of_maps(maps: Iterable[CorrespondenceMap], past: Past | None = None) -> Feed:
    """Return maps as the frames of a sequence; ``past`` as in :func:`frames_of`."""

    def arriving() -> Iterator[Arrival]:
        for map_ in maps:
            digest = digest_of(np.ascontiguousarray(map_.q).data)
            yield Arrival(map_.name, digest, partial(lambda given: given, map_))

    marks, where = (past.marks, past.where) if past else ([], "")
    return Feed(arriving(), len(maps) if isinstance(maps, Sequence) else None, marks, where)


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


def _loaded(files: Sequence[Path]) -> Iterator[Arrival]:
    for file, name in zip(files, frame_names(files), strict=True):
        try:
            digest = digest_of(read_bytes(file, MAP))
        except InputError as error:
            digest = error.what  # and the frame will say it
        yield Arrival(name, digest, partial(_map, file, name))


def _map(file: Path, name: str) -> Incoming:
    try:
        return replace(load_map(file), name=name)
    except InputError as error:
        return Unread(name, error.what)


def _decoded(
    images: Iterator[ImageFrame], rig: Rig, pattern: str | None, refine: bool
) -> Iterator[Arrival]:
    decoder = ImageDecoder(rig, pattern, refine=refine)
    for image in images:
        pixels = np.ascontiguousarray(image.image).data
        yield Arrival(image.name, digest_of(pixels), partial(_read, decoder, image))


def _read(decoder: ImageDecoder, image: ImageFrame) -> Incoming:
    decoded = decoder.decode(image)
    if decoded.grid.reason:
        return Unread(image.name, decoded.grid.reason)
    found = decoded.map.map
    values = {field.name: getattr(found, field.name) for field in fields(found)}
    return PicturedMap(**values, picture=_picture(image))


def _picture(image: ImageFrame) -> NDArray[np.uint8]:
    """Return (H, W, 3) RGB of 8 bits."""
    pixels = np.broadcast_to(image.image[..., :3], (*image.image.shape[:2], 3))
    return np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)


def digest_of(data: bytes | memoryview) -> str:
    """Return what tells contents from others."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()

"""Frames of a sequence from files, one at a time: maps, images, folders of either, videos."""

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..decoding.frame_files import frame_files, is_map
from ..decoding.image_files import ImageFrame, is_images, read_frames
from ..errors import InputError
from ..reading.regular import MAP, read_bytes, regular
from ..records.correspondence import CorrespondenceMap, frame_names, load_map
from ..records.rig import Rig
from ..refine.image_decoder import ImageDecoder
from .frame_reading import AS_IT_IS, FrameReading
from .frames import Incoming, PicturedMap, Unread
from .resume import Past


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
        checked = 0
        for arrival in self._arriving:
            if checked < len(self.past):
                self._check(checked, arrival)
                checked += 1
            else:
                self.marks.append(arrival.mark)
                yield arrival.frame()
        if checked < len(self.past):
            raise InputError(
                f"the sequence to go on with has {len(self.past)} frames, and {checked} are given",
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
    reading: FrameReading = AS_IT_IS,
    *,
    past: Past | None = None,
) -> Feed:
    """Return the frames of files.

    What is no map, shows no pattern or has no mask is a frame without a map and says why.

    Args:
        paths: correspondence maps, or images of the coded grid and videos; folders of either.
        rig: size of image and pattern.
        chosen: which frames.
        reading: what is said of the files.
        past: an earlier run, whose frames are the first ones and are not read again.

    Raises:
        InputError: a file is missing, maps and images at once, options for images with maps or for
            maps with images, a mask of another size, no frame is left, or the earlier run read
            otherwise.
    """
    files = frame_files([_recognised(path) for path in paths])
    maps = [file for file in files if is_map(file)]
    if maps and len(maps) < len(files):
        raise InputError("maps and images are given", str(maps[0]), "give one kind")
    reading.check(rig, maps=bool(maps))
    if past is not None:
        past.check_reading(reading)
    marks, where = (past.marks, past.where) if past else ([], "")
    if not maps:
        images = islice(read_frames(files), chosen.start, chosen.end, chosen.stride)
        return Feed(_decoded(images, rig, reading), None, marks, where)
    for file in maps:
        regular(file, MAP)
    used = maps[chosen.start : chosen.end : chosen.stride]
    if not used:
        raise InputError(f"of {len(maps)} frames none is left", "--start", "choose an earlier one")
    return Feed(_loaded(used, rig, reading), len(used), marks, where)


def feed_of_maps(
    maps: Iterable[CorrespondenceMap],
    reading: FrameReading = AS_IT_IS,
    past: Past | None = None,
) -> Feed:
    """Return maps as the frames of a sequence; of ``reading`` its mask, ``past`` as above."""

    def arriving() -> Iterator[Arrival]:
        for map_ in maps:
            digest = digest_of(np.ascontiguousarray(map_.q).data)
            yield Arrival(map_.name, digest, partial(_masked, map_, reading))

    if past is not None:
        past.check_reading(reading)
    marks, where = (past.marks, past.where) if past else ([], "")
    return Feed(arriving(), len(maps) if isinstance(maps, Sequence) else None, marks, where)


def _recognised(path: Path) -> Path:
    """Refuse what is neither a map nor images, by its name."""
    if not is_images(path) and not is_map(path):
        raise InputError(
            f"unknown kind of file '{path.suffix}'", str(path), "give maps, images or videos"
        )
    return path


def _loaded(files: Sequence[Path], rig: Rig, reading: FrameReading) -> Iterator[Arrival]:
    for file, name in zip(files, frame_names(files), strict=True):
        try:
            digest = digest_of(read_bytes(file, MAP))
        except InputError as error:
            digest = error.what  # and the frame will say it
        yield Arrival(name, digest, partial(_map, file, name, rig, reading))


def _map(file: Path, name: str, rig: Rig, reading: FrameReading) -> Incoming:
    size = rig.projector.width, rig.projector.height
    try:
        map_ = replace(load_map(file, reading.convention, size), name=name)
    except InputError as error:
        return Unread(name, error.what, error.todo or "")
    return _masked(map_, reading)


def _masked(map_: CorrespondenceMap, reading: FrameReading) -> Incoming:
    masks = reading.masks
    if masks is None:
        return map_
    try:
        return masks.applied(map_)
    except InputError as error:
        return Unread(map_.name, f"{error.where} {error.what}", error.todo or "")


def _decoded(images: Iterator[ImageFrame], rig: Rig, reading: FrameReading) -> Iterator[Arrival]:
    decoder = ImageDecoder(rig, reading.pattern, refine=reading.refine)
    for image in images:
        pixels = np.ascontiguousarray(image.image).data
        yield Arrival(image.name, digest_of(pixels), partial(_read, decoder, image, reading))


def _read(decoder: ImageDecoder, image: ImageFrame, reading: FrameReading) -> Incoming:
    decoded = decoder.decode(image)
    if decoded.grid.reason:
        return Unread(image.name, decoded.grid.reason)
    map_ = decoded.map.map
    values = {field.name: getattr(map_, field.name) for field in fields(map_)}
    return _masked(PicturedMap(**values, picture=_picture(image)), reading)


def _picture(image: ImageFrame) -> NDArray[np.uint8]:
    """Return (H, W, 3) RGB of 8 bits."""
    pixels = np.broadcast_to(image.image[..., :3], (*image.image.shape[:2], 3))
    return np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)


def digest_of(data: bytes | memoryview) -> str:
    """Return what tells contents from others."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()

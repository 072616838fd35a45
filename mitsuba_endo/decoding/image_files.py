"""Images on disk: single files, folders and videos."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading.image_header import image_size
from ..reading.image_tags import TIFFS, TURNED, image_count, is_mosaic, orientation
from ..reading.quiet import quiet
from ..reading.regular import IMAGE, PIXELS, read_bytes
from .video_files import read_video

SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".webp", ".pgm", ".ppm")
VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg", ".mpeg")
DEPTHS = (8, 10, 12, 14, 16)
"""Bits of common sensors: 16-bit files often hold fewer."""
FLOAT_STEPS = 65535
"""Steps to which brightness from 0 to 1 is rounded where files hold it as floats."""


@dataclass(frozen=True)
class Page:
    """One image of a file of several."""

    path: Path
    index: int

    @property
    def stem(self) -> str:
        """The file's name with the number of the page."""
        return f"{self.path.stem}_{self.index:05d}"

    def __str__(self) -> str:
        return f"{self.path} image {self.index}"


ImageSource = Path | Page


@dataclass(frozen=True, eq=False)
class StoredImage:
    """An image as it is stored, turned upright."""

    pixels: NDArray[np.integer]
    """(H, W, C) of 8 or 16 bits."""
    note: str = ""
    """What its reader should know, a sentence."""


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """One image."""

    name: str
    """File name without suffix; of a video with the number of the frame."""
    source: str
    """Path, for messages."""
    image: NDArray[np.float32]
    """(H, W, C), 1 = full scale."""
    note: str = ""
    """What was done to it that its reader should know, a sentence; the same for all frames of a
    file."""


def is_images(path: Path) -> bool:
    """Tell whether a path is an image, a video or a folder, by its name."""
    return path.is_dir() or path.suffix.lower() in SUFFIXES + VIDEOS


def read_frames(paths: Sequence[Path]) -> Iterator[ImageFrame]:
    """Yield the images of files, folders and videos, one after the other.

    Raises:
        InputError: a file is missing, damaged or of another kind, two images have one name, or a
            folder holds no image.
    """
    names: set[str] = set()
    for path in (inside for given in paths for inside in _files(given)):
        for frame in _video(path) if path.suffix.lower() in VIDEOS else _image(path):
            if frame.name in names:
                raise InputError("two images have this name", frame.name, "rename one file")
            names.add(frame.name)
            yield frame


def _files(path: Path) -> list[Path]:
    return images_of(path, SUFFIXES + VIDEOS) if path.is_dir() else [path]


def images_of(folder: Path, suffixes: Sequence[str] = SUFFIXES) -> list[Path]:
    """Return the images of a folder, by number and name.

    Raises:
        InputError: there is none.
    """
    inside = [p for p in visible(folder) if p.suffix.lower() in suffixes]
    if not inside:
        raise InputError("holds no image", str(folder), f"put {', '.join(suffixes)} there")
    return sorted(inside, key=natural_order)


def visible(folder: Path) -> list[Path]:
    """Return what a folder holds but for hidden files, as macOS puts one beside each image.

    Raises:
        InputError: the folder cannot be read.
    """
    try:
        return [path for path in folder.iterdir() if not path.name.startswith(".")]
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read ({reason})", str(folder), "check the folder") from None


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Return a key that sorts names by the numbers in them."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(p), "") if p.isdigit() else (-1, p) for p in parts if p]


def _image(path: Path) -> Iterator[ImageFrame]:
    for source in images_in(path):
        stored = open_image(source)
        scaled = np.divide(stored.pixels, full_scale(stored.pixels), dtype=np.float32)
        yield ImageFrame(source.stem, str(source), scaled, stored.note)


def _video(path: Path) -> Iterator[ImageFrame]:
    for number, (pixels, note) in enumerate(read_video(path)):
        yield ImageFrame(f"{path.stem}_{number:05d}", f"{path} frame {number}",
                    np.divide(pixels, 255, dtype=np.float32), note)  # fmt: skip


def images_in(path: Path) -> Sequence[ImageSource]:
    """Return the images of a file: itself, or the pages of a TIFF file.

    Raises:
        InputError: as :func:`read_bytes`.
    """
    data = read_bytes(path, IMAGE, "no such image")
    count = image_count(data) if data[:4] in TIFFS else 1
    return [path] if count == 1 else [Page(path, k) for k in range(count)]


def read_image(source: ImageSource) -> NDArray[np.integer]:
    """Read (H, W, C) of 8 or 16 bits, turned upright; see :func:`open_image`."""
    return open_image(source).pixels


def open_image(source: ImageSource) -> StoredImage:
    """Read an image; an alpha channel is left out, floats from 0 to 1 become 16 bits.

    Raises:
        InputError: missing, damaged, of another kind, or several images where one is wanted.
    """
    path, index = (source.path, source.index) if isinstance(source, Page) else (source, None)
    data = read_bytes(path, IMAGE, "no such image")
    size = image_size(data)
    if size is None:
        raise InputError("is not a readable image", str(path), "make it again")
    # Of three channels with two bytes at most.
    PIXELS.check(6 * size[0] * size[1], path)
    _check_kind(data, path, single=index is None)
    image = _decoded(data) if index is None else _page(path, index)
    if image is None:
        raise InputError("is not a readable image", str(source), "make it again")
    pixels = _whole(np.asarray(image), str(source))
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels[..., :3]
    # OpenCV turns TIFF files itself.
    turn = orientation(data)
    if turn in TURNED and data[:4] not in TIFFS:
        pixels = np.ascontiguousarray(TURNED[turn][1](pixels))
    note = "" if turn == 1 else turned_note(path, TURNED[turn][0])
    return StoredImage(pixels, note)


def turned_note(path: Path, how: str) -> str:
    """Return the sentence about an orientation tag that is not neutral."""
    return (
        f"{path}: is {how}, as its orientation tag says; the camera matrix must be of images "
        "turned likewise"
    )


def _check_kind(data: bytes, path: Path, *, single: bool) -> None:
    if single and image_count(data) > 1:
        what = f"holds {image_count(data)} images"
        raise InputError(what, str(path), "save the one that is meant as a file of its own")
    if is_mosaic(data):
        raise InputError("is a raw Bayer mosaic", str(path), "develop it to colour or gray")


def _decoded(data: bytes) -> "NDArray[Any] | None":
    try:
        with quiet():  # the libraries under OpenCV print what they think of damaged files
            return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None


def _page(path: Path, index: int) -> "NDArray[Any] | None":
    try:
        with quiet():
            _, pages = cv2.imreadmulti(str(path), index, 1, flags=cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    return np.asarray(pages[0]) if len(pages) else None


def _whole(image: NDArray[Any], source: str) -> NDArray[np.integer]:
    """Return pixels of 8 or 16 bits."""
    if image.dtype in (np.uint8, np.uint16):
        return image
    if image.dtype.kind != "f":
        raise InputError(f"is {image.dtype}", source, "give 8- or 16-bit images")
    low, high = float(image.min()), float(image.max())
    if not (low >= 0 and high <= 1):
        what = f"holds floats from {low:g} to {high:g}"
        raise InputError(what, source, "give brightness from 0 to 1, or 8- or 16-bit images")
    return np.rint(image * np.float64(FLOAT_STEPS)).astype(np.uint16)


def full_scale(image: NDArray[np.integer]) -> int:
    """Return the full scale of an image: see :func:`depth_scale`."""
    return depth_scale(int(image.max()), image.dtype)


def depth_scale(brightest: int, kind: "np.dtype[Any]") -> int:
    """Return the full scale of images of one kind: of 16 bits the least depth that holds them.

    Args:
        brightest: value of them all.
        kind: 8 or 16 bits, unsigned.
    """
    depths = DEPTHS[1:] if kind == np.uint16 else DEPTHS
    return 2 ** next(bits for bits in depths if brightest < 2**bits) - 1

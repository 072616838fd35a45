"""Images on disk: single files, folders and videos."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

SUFFIXES = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm", ".ppm")
VIDEOS = (".mp4", ".avi", ".mkv", ".mov", ".webm", ".m4v", ".mpg", ".mpeg")
DEPTHS = (8, 10, 12, 14, 16)
"""Bits of common sensors: 16-bit files often hold fewer."""


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """One image."""

    name: str
    """File name without suffix; of a video with the number of the frame."""
    source: str
    """Path, for messages."""
    image: NDArray[np.float32]
    """(H, W, C), 1 = full scale."""


def is_images(path: Path) -> bool:
    """Tell whether a path is an image, a video or a folder, by its name."""
    return path.is_dir() or path.suffix.lower() in SUFFIXES + VIDEOS


def read_frames(paths: Sequence[Path]) -> Iterator[ImageFrame]:
    """Yield the images of files, folders and videos, one after the other.

    Raises:
        InputError: a file is missing, damaged or of another kind, two images have one name, or a
            folder holds no image.
    """
    seen: set[str] = set()
    for path in (inside for given in paths for inside in _files(given)):
        for frame in _video(path) if path.suffix.lower() in VIDEOS else _image(path):
            if frame.name in seen:
                raise InputError("two images have this name", frame.name, "rename one file")
            seen.add(frame.name)
            yield frame


def _files(path: Path) -> list[Path]:
    return images_of(path, SUFFIXES + VIDEOS) if path.is_dir() else [path]


def images_of(folder: Path, suffixes: Sequence[str] = SUFFIXES) -> list[Path]:
    """Return the images of a folder, by number and name.

    Raises:
        InputError: there is none.
    """
    inside = [p for p in folder.iterdir() if p.suffix.lower() in suffixes]
    if not inside:
        raise InputError("holds no image", str(folder), f"put {', '.join(SUFFIXES)} there")
    return sorted(inside, key=_natural)


def _natural(path: Path) -> list[tuple[int, str]]:
    parts = re.split(r"(\d+)", path.name.lower())
    return [(int(p), "") if p.isdigit() else (-1, p) for p in parts if p]


def _image(path: Path) -> Iterator[ImageFrame]:
    raw = read_image(path)
    yield ImageFrame(path.stem, str(path), (raw / full_scale(raw)).astype(np.float32))


def _video(path: Path) -> Iterator[ImageFrame]:
    if not path.is_file():
        raise InputError("no such video", str(path), "check the path")
    video = cv2.VideoCapture(str(path))
    try:
        found = 0
        while True:
            read, raw = video.read()
            if not read:
                break
            yield ImageFrame(f"{path.stem}_{found:05d}", f"{path} frame {found}",
                        (np.asarray(raw) / 255).astype(np.float32))  # fmt: skip
            found += 1
    finally:
        video.release()
    if not found:
        raise InputError("is not a readable video", str(path), "convert it, e.g. to PNG images")


def read_image(path: Path) -> NDArray[np.integer]:
    """Read (H, W, C) of 8 or 16 bits; an alpha channel is left out.

    Raises:
        InputError: missing, damaged or of another kind.
    """
    if not path.is_file():
        raise InputError("no such image", str(path), "check the path")
    # Decoding from memory: OpenCV's own reader prints to stderr about damaged files.
    data = np.fromfile(path, np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if len(data) else None
    if image is None:
        raise InputError("is not a readable image", str(path), "make it again")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"is {image.dtype}", str(path), "give 8- or 16-bit images")
    pixels: NDArray[np.integer] = np.asarray(image)  # pyright: ignore[reportAssignmentType]
    return pixels[..., None] if pixels.ndim == 2 else pixels[..., :3]


def full_scale(*images: NDArray[np.integer]) -> int:
    """Return the full scale of images of one kind: of 16 bit the least depth that holds them."""
    brightest = max(int(image.max()) for image in images)
    depths = DEPTHS[1:] if images[0].dtype == np.uint16 else DEPTHS
    return 2 ** next(b for b in depths if brightest < 2**b) - 1

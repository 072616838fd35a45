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
from ..reading.quiet import quiet
from ..reading.regular import IMAGE, PIXELS, VIDEO, read_bytes, regular

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
    scaled = np.divide(raw, full_scale(raw), dtype=np.float32)
    yield ImageFrame(path.stem, str(path), scaled)


def _video(path: Path) -> Iterator[ImageFrame]:
    regular(path, VIDEO, "no such video")
    with quiet():
        video = cv2.VideoCapture(str(path))
    try:
        found = 0
        _check_frames(video, path)
        while True:
            with quiet():
                read, raw = video.read()
            if not read:
                break
            yield ImageFrame(f"{path.stem}_{found:05d}", f"{path} frame {found}",
                        np.divide(raw, 255, dtype=np.float32))  # fmt: skip
            found += 1
    finally:
        video.release()
    if not found:
        raise InputError("is not a readable video", str(path), "convert it, e.g. to PNG images")


def _check_frames(video: cv2.VideoCapture, path: Path) -> None:
    width, height = (video.get(p) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    PIXELS.check(int(min(3 * width * height, 2**50)), path)


def read_image(path: Path) -> NDArray[np.integer]:
    """Read (H, W, C) of 8 or 16 bits; an alpha channel is left out.

    Raises:
        InputError: missing, damaged or of another kind.
    """
    data = read_bytes(path, IMAGE, "no such image")
    size = image_size(data)
    if size is None:
        raise InputError("is not a readable image", str(path), "make it again")
    # Of three channels with two bytes at most.
    PIXELS.check(6 * size[0] * size[1], path)
    try:
        with quiet():  # the libraries under OpenCV print what they think of damaged files
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise InputError("is not a readable image", str(path), "make it again")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"is {image.dtype}", str(path), "give 8- or 16-bit images")
    pixels: NDArray[np.integer] = np.asarray(image)  # pyright: ignore[reportAssignmentType]
    return pixels[..., None] if pixels.ndim == 2 else pixels[..., :3]


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

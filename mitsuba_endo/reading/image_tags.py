"""What an image's file says beside its pixels: how it is turned, and how many images it holds.

Formats: EXIF 2.32, PNG (RFC 2083 and its extensions eXIf and acTL), WebP's container, TIFF 6.0.
"""

import struct
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from .tiff_tags import COLOURS, MOSAIC, ORIENTATION, REDUCED, SUBFILE, directories

PNG, JPEG, TIFFS = b"\x89PNG\r\n\x1a\n", b"\xff\xd8", (b"II*\0", b"MM\0*")
"""First bytes of a file, which its format's specification gives."""
TURNED: dict[int, tuple[str, Callable[[NDArray[np.integer]], NDArray[np.integer]]]] = {
    2: ("mirrored", lambda image: image[:, ::-1]),
    3: ("turned by 180 degrees", lambda image: image[::-1, ::-1]),
    4: ("turned upside down and mirrored", lambda image: image[::-1]),
    5: ("turned and mirrored", lambda image: image.swapaxes(0, 1)),
    6: ("turned by 90 degrees", lambda image: image.swapaxes(0, 1)[:, ::-1]),
    7: ("turned and mirrored", lambda image: image[::-1, ::-1].swapaxes(0, 1)),
    8: ("turned by 270 degrees", lambda image: image.swapaxes(0, 1)[::-1]),
}
"""What to do to stored pixels by EXIF's orientation, clockwise; 1 is neutral."""


def orientation(data: bytes) -> int:
    """Return EXIF's orientation of an image, 1 to 8; 1 if it has none."""
    try:
        code = next(directories(_exif(data)), {}).get(ORIENTATION, 1)
    except (struct.error, IndexError):
        return 1
    return code if code in TURNED else 1


def image_count(data: bytes) -> int:
    """Return how many images a file holds: pages or an animation's frames, previews left out."""
    try:
        if data[:4] in TIFFS:
            pages = [page.get(SUBFILE, 0) & REDUCED for page in directories(data)]
            return max(1, pages.count(0))
        chunks = list(_chunks(data))
        counts = [struct.unpack(">I", part[:4])[0] for name, part in chunks if name == b"acTL"]
    except (struct.error, IndexError):
        return 1
    return max(1, sum(name == b"ANMF" for name, _ in chunks), *counts)


def is_mosaic(data: bytes) -> bool:
    """Tell whether a TIFF file says that it holds raw values under coloured filters."""
    try:
        return data[:4] in TIFFS and next(directories(data), {}).get(COLOURS) == MOSAIC
    except struct.error:
        return False


def _exif(data: bytes) -> bytes:
    """Return the EXIF block, which is a TIFF file, or nothing."""
    if data[:4] in TIFFS:
        return data
    parts = _segments(data) if data.startswith(JPEG) else _chunks(data)
    for name, part in parts:
        if name in (b"eXIf", b"EXIF", b"\xe1") and part.removeprefix(b"Exif\0\0")[:4] in TIFFS:
            return part.removeprefix(b"Exif\0\0")
    return b""


def _chunks(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the chunks of PNG and WebP files by name."""
    png = data.startswith(PNG)
    if not png and data[8:12] != b"WEBP":
        return
    at = len(PNG) if png else 12
    while at + 8 <= len(data):
        if png:
            length, name = struct.unpack(">I4s", data[at : at + 8])
        else:
            name, length = struct.unpack("<4sI", data[at : at + 8])
        yield name, data[at + 8 : at + 8 + length]
        at += 12 + length if png else 8 + length + length % 2


def _segments(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the segments of a JPEG file before its pixels, by marker."""
    at = len(JPEG)
    while at + 4 <= len(data) and data[at] == 0xFF and data[at + 1] != 0xDA:
        if data[at + 1] == 0xFF:  # fill bytes
            at += 1
            continue
        (length,) = struct.unpack(">H", data[at + 2 : at + 4])
        yield data[at + 1 : at + 2], data[at + 4 : at + 2 + length]
        at += 2 + length

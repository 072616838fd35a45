"""The header of an OpenEXR file, looked at before anything is allocated for its pixels.

Layout: https://openexr.com/en/latest/OpenEXRFileLayout.html.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from .regular import MAP, regular

_MAGIC = 20000630
"""First four bytes, little-endian; like the flags below from OpenEXR's file layout."""
_LONGEST = 1 << 20
"""Bytes of header that are looked at; cameras write a few thousand."""
_TILED, _DEEP, _PARTS = 0x200, 0x800, 0x1000
"""Bits of the version field: tiles, deep data, several parts."""
_LINES = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256)
"""Lines of a chunk by the number of the compression; later ones have at most as many."""
_LOSSY = (6, 7, 8, 9)
"""B44, B44A, DWAA, DWAB; PXR24 keeps 16 binary digits of a number."""
_RATIO = (1, 128, 1032, 1032)
"""How much none, run lengths and deflate (of one line, of 16) shrink at most; others at will."""
_CHUNK = 16
"""Bytes that a chunk takes at least: its offset in the table, its line and its length."""
_SLACK = 64
"""Bytes added to the file's size before it is judged: what holds little hardly shrinks.
Chosen."""


@dataclass(frozen=True)
class Header:
    """What the header says of the pixels."""

    width: int
    height: int
    channels: int
    sample_bytes: int
    """Bytes of one pixel, all channels."""
    offset: tuple[int, int]
    """Row and column of the first pixel in the picture that the file shows."""
    shown: tuple[int, int]
    """Rows and columns of that picture."""
    compression: int
    tiled: bool
    subsampled: bool

    @property
    def lossy(self) -> bool:
        """Whether the compression changes 32-bit numbers by more than rounding."""
        return self.compression in _LOSSY

    @property
    def bytes(self) -> int:
        """Taken in memory, as 32-bit numbers."""
        rows, columns = self.shown
        return 4 * max(self.width * self.height, rows * columns) * self.channels


def check_exr(path: str | Path) -> tuple[Header, ...]:
    """Return the headers of a file's parts, refusing what promises more than the file can hold.

    Raises:
        InputError: missing, no OpenEXR file, deep, or too large for the memory.
    """
    size = regular(path, MAP)
    try:
        with Path(path).open("rb") as file:
            headers = _parse(file.read(min(size, _LONGEST)))
    except (struct.error, ValueError, IndexError, OSError):
        raise InputError("is not a readable OpenEXR file", str(path), "make it again") from None
    MAP.check(sum(header.bytes for header in headers), path)
    if any(header.subsampled for header in headers):
        raise InputError("has channels of fewer pixels", str(path), "store all at full size")
    if not all(_holds(header, size) for header in headers):
        raise InputError("is cut short", str(path), "make it again")
    return headers


def _holds(header: Header, size: int) -> bool:
    raw = header.width * header.height * header.sample_bytes
    if header.compression < len(_RATIO) and raw > _RATIO[header.compression] * (size + _SLACK):
        return False
    listed = header.compression < len(_LINES)
    chunks = -(-header.height // (_LINES[header.compression] if listed else max(_LINES)))
    return header.tiled or chunks * _CHUNK <= size


def _parse(data: bytes) -> tuple[Header, ...]:
    magic, version = struct.unpack_from("<ii", data, 0)
    if magic != _MAGIC or version & _DEEP:
        raise ValueError("no picture")
    at, headers = 8, []
    while True:
        attributes, at = _attributes(data, at)
        headers.append(_header(attributes, tiled=bool(version & _TILED)))
        # Of several parts, an empty header ends the list.
        if not version & _PARTS or not data[at]:
            return tuple(headers)


def _header(attributes: dict[str, bytes], *, tiled: bool) -> Header:
    kind = attributes.get("type", b"")
    if kind.startswith(b"deep"):
        raise ValueError("no picture")
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    if width < 1 or height < 1:
        raise ValueError("no pixels")
    x, y, x_last, y_last = struct.unpack(
        "<4i", attributes.get("displayWindow", attributes["dataWindow"])
    )
    bytes_, samplings = _channels(attributes["channels"])
    return Header(
        width, height, len(bytes_), sum(bytes_), (top - y, left - x),
        (max(1, y_last - y + 1), max(1, x_last - x + 1)), attributes["compression"][0],
        tiled or kind.startswith(b"tiled"), any(s != (1, 1) for s in samplings),
    )  # fmt: skip


def _attributes(data: bytes, at: int) -> tuple[dict[str, bytes], int]:
    """Return a header's attributes and where it ends."""
    attributes = {}
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        (length,) = struct.unpack_from("<i", data, at)
        if length < 0 or at + 4 + length > len(data):
            raise ValueError("cut short")
        attributes[name] = data[at + 4 : at + 4 + length]
        at += 4 + length
    if not {"dataWindow", "compression", "channels"} <= attributes.keys():
        raise ValueError("an attribute is missing")
    return attributes, at + 1


def _channels(data: bytes) -> tuple[list[int], list[tuple[int, int]]]:
    at, sizes, samplings = 0, [], []
    while data[at]:
        _, at = _text(data, at)
        kind, _, across, down = struct.unpack_from("<4i", data, at)
        sizes.append({0: 4, 1: 2, 2: 4}.get(kind, 4))
        samplings.append((across, down))
        at += 16
    if not sizes:
        raise ValueError("no channels")
    return sizes, samplings


def _text(data: bytes, at: int) -> tuple[str, int]:
    end = data.index(b"\0", at, at + 256)
    return data[at:end].decode("latin-1"), end + 1

"""Width and height in the headers of images, looked at before a library decodes them.

Formats: PNG (RFC 2083), JPEG (ITU T.81), TIFF 6.0, BMP, Netpbm, WebP (RFC 9649).
"""

import struct
from collections.abc import Iterator

from .tiff_tags import HEIGHT, WIDTH, directories

_SLACK = 4096
"""Bytes of a text header that are read, and by which a file may seem too short. Chosen: a page."""
_PNG = b"\x89PNG\r\n\x1a\n"
_DEFLATE = 1032
"""How much deflate shrinks at most."""


def image_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height, pixels; None where the format is unknown or the header damaged.

    Also None if the file cannot hold that many pixels.
    """
    for magic, read in _READERS.items():
        if data.startswith(magic):
            try:
                width, height = read(data)
            except (struct.error, ValueError, IndexError, StopIteration):
                return None
            return (width, height) if width > 0 and height > 0 else None
    return None


def _png(data: bytes) -> tuple[int, int]:
    width, height, bits, colour = struct.unpack(">IIBB", data[16:26])
    if data[12:16] != b"IHDR":
        raise ValueError
    samples = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(colour, 4)
    _check(width * height * samples * bits // 8, _DEFLATE * len(data))
    at = len(_PNG)
    while at < len(data):  # OpenCV takes memory for a chunk as long as it says it is
        (length,) = struct.unpack(">I", data[at : at + 4])
        at += length + 12
    if at > len(data):
        raise ValueError
    return width, height


def _jpeg(data: bytes) -> tuple[int, int]:
    at = 2
    while True:
        if data[at] != 0xFF:
            raise ValueError
        marker = data[at + 1]
        if marker == 0xFF:  # fill bytes
            at += 1
            continue
        if marker == 0x01 or 0xD0 <= marker <= 0xD8:
            at += 2
            continue
        (length,) = struct.unpack(">H", data[at + 2 : at + 4])
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return width, height
        if marker == 0xDA or length < 2:
            raise ValueError
        at += 2 + length


def _bmp(data: bytes) -> tuple[int, int]:
    (head,) = struct.unpack("<I", data[14:18])
    if head == 12:
        width, height, _, bits = struct.unpack("<HHHH", data[18:26])
        packed = 0
    else:
        width, height, _, bits, packed = struct.unpack("<iiHHI", data[18:34])
    if packed not in (1, 2):  # run lengths
        _check(abs(width * height) * bits // 8, len(data))
    return width, abs(height)


def _netpbm(data: bytes) -> tuple[int, int]:
    words = _words(data[2:])
    width, height = int(next(words)), int(next(words))
    channels = 3 if data[1:2] in b"36" else 1
    _check(width * height * channels // (8 if data[1:2] in b"14" else 1), len(data))
    return width, height


def _words(data: bytes) -> Iterator[bytes]:
    """Yield the words of a Netpbm header, comments left out."""
    for line in data[:_SLACK].split(b"\n"):
        for word in line.partition(b"#")[0].split():
            if len(word) > 9:
                raise ValueError
            yield word


def _tiff(data: bytes) -> tuple[int, int]:
    tags = next(directories(data))
    return tags.get(WIDTH, 0), tags.get(HEIGHT, 0)


def _webp(data: bytes) -> tuple[int, int]:
    """Read the first chunk: lossy (RFC 6386), lossless, or the extended header."""
    kind = data[12:16]
    if data[8:12] != b"WEBP":
        raise ValueError
    if kind == b"VP8X":
        (low, high, low_y, high_y) = struct.unpack("<HBHB", data[24:30])
        return low + (high << 16) + 1, low_y + (high_y << 16) + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack("<I", data[21:25])
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind != b"VP8 " or data[23:26] != b"\x9d\x01\x2a":
        raise ValueError
    width, height = struct.unpack("<HH", data[26:30])
    return width & 0x3FFF, height & 0x3FFF


def _check(needed: int, held: int) -> None:
    if needed > held + _SLACK:
        raise ValueError


_READERS = {
    _PNG: _png,
    b"\xff\xd8": _jpeg,
    b"BM": _bmp,
    b"II*\0": _tiff,
    b"MM\0*": _tiff,
    b"RIFF": _webp,
    **{b"P%d" % kind: _netpbm for kind in range(1, 7)},
}
"""By the first bytes of a file, which its format's specification gives."""

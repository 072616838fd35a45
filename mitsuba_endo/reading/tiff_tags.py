"""Directories of TIFF files, which EXIF blocks are too: whole numbers by their tags.

Format: TIFF 6.0, section 2.
"""

import struct
from collections.abc import Iterator

WIDTH, HEIGHT, ORIENTATION, SUBFILE, COLOURS = 256, 257, 274, 254, 262
"""Tags by TIFF 6.0."""
REDUCED = 1
"""Bit of SUBFILE: a smaller copy of another page, as cameras add for previews."""
MOSAIC = 32803
"""Value of COLOURS in TIFF/EP: raw values under a filter of coloured pixels."""
_MOST = 10_000
"""Pages followed, lest a directory names itself as its next. Chosen."""
_FORMS = {1: "B", 3: "H", 4: "I"}
"""Kinds of whole numbers by TIFF 6.0."""


def directories(data: bytes) -> Iterator[dict[int, int]]:
    """Yield the single whole numbers of each directory, by tag.

    Raises:
        struct.error: the file is cut short.
    """
    order = "<" if data[:2] == b"II" else ">"
    (at,) = struct.unpack(f"{order}I", data[4:8])
    offsets: set[int] = set()
    while at and at not in offsets and len(offsets) < _MOST:
        offsets.add(at)
        (count,) = struct.unpack(f"{order}H", data[at : at + 2])
        end = at + 2 + 12 * count
        tags: dict[int, int] = {}
        for entry in range(at + 2, end, 12):
            tag, kind, number = struct.unpack(f"{order}HHI", data[entry : entry + 8])
            form = f"{order}{_FORMS.get(kind, 'B')}"
            if number == 1 and kind in _FORMS:
                (tags[tag],) = struct.unpack_from(form, data[entry + 8 : entry + 12])
        yield tags
        (at,) = struct.unpack(f"{order}I", data[end : end + 4])

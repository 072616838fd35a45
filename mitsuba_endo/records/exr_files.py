"""Channels of OpenEXR files: read whole, whatever parts and layers they lie in, and written."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..reading.exr_header import Header, check_exr
from ..reading.quiet import quiet

Channels = dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class ExrFile:
    """What an OpenEXR file holds."""

    channels: Channels
    """(H, W) by name; where two parts name theirs alike, with the part's name before it."""
    numbers: dict[str, float]
    """Of the parts' headers."""
    lossy: bool
    """The compression changes numbers by more than rounding."""


def read_exr(path: str | Path) -> Channels:
    """Read every channel of an OpenEXR file, of all its parts, as (H, W) float32.

    Raises:
        InputError: missing or damaged file.
    """
    return open_exr(path).channels


def open_exr(path: str | Path) -> ExrFile:
    """Read an OpenEXR file whole; pixels that it shows and does not hold are NaN.

    Raises:
        InputError: missing or damaged file.
    """
    headers = check_exr(path)
    try:
        with quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
            parts = list(zip(file.parts, headers, strict=True))
            count = Counter(name for part, _ in parts for name in part.channels)
            channels = {
                f"{part.name()}.{name}" if count[name] > 1 else name: _placed(
                    np.array(channel.pixels, np.float32), header
                )
                for part, header in parts
                for name, channel in part.channels.items()
            }
            numbers = {
                str(name): float(value)
                for part, _ in parts
                for name, value in part.header.items()
                if isinstance(value, int | float)
            }
    except (RuntimeError, ValueError, TypeError, MemoryError):
        raise InputError("is not a readable OpenEXR file", str(path), "make it again") from None
    return ExrFile(channels, numbers, any(header.lossy for header in headers))


def _placed(pixels: NDArray[np.float32], header: Header) -> NDArray[np.float32]:
    """Return the pixels where the picture shows them: writers cut off empty borders."""
    if header.offset == (0, 0) and header.shown == pixels.shape:
        return pixels
    whole = np.full(header.shown, np.float32(np.nan))
    (row, column), (height, width) = header.offset, pixels.shape
    window = whole[max(0, row) : max(0, row + height), max(0, column) : max(0, column + width)]
    top, left = max(0, -row), max(0, -column)
    window[:] = pixels[top : top + window.shape[0], left : left + window.shape[1]]
    return whole


def write_exr(
    path: str | Path,
    channels: dict[str, NDArray[np.floating]],
    attributes: dict[str, float] | None = None,
) -> None:
    """Write (H, W) channels as a float32 OpenEXR file, with numbers in its header.

    Raises:
        InputError: the file cannot be written.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    arrays = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in channels.items()}
    with atomic_path(path) as aside:
        try:
            OpenEXR.File(header | (attributes or {}), arrays).write(str(aside))
        except RuntimeError as error:  # how OpenEXR reports a full disk
            raise OSError(str(error)) from error

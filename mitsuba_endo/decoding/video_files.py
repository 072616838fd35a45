"""Frames of videos, turned as their tags say."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..reading.quiet import quiet
from ..reading.regular import PIXELS, VIDEO, regular

_DEEP = range(9, 17)
"""Bits of a sample. FFmpeg's tags of raw formats (libavcodec/raw.c) of more than 8 bits hold their
number as the last byte, or the first where the byte order is the other one."""
_BAYER = 0xBA
"""First byte of its tags of mosaics."""


def read_video(path: Path) -> Iterator[tuple[NDArray[np.uint8], str]]:
    """Yield each frame (H, W, 3), and what the reader of them all should know, a sentence.

    Raises:
        InputError: missing, damaged, without frames, too large, or a mosaic.
    """
    regular(path, VIDEO, "no such video")
    with quiet():
        video = cv2.VideoCapture(str(path))
    try:
        count = 0
        _check(video, path)
        note = _note(video, path)
        while True:
            with quiet():
                read, pixels = video.read()
            if not read:
                break
            yield np.asarray(pixels, np.uint8), note
            count += 1
    finally:
        video.release()
    if not count:
        raise InputError("is not a readable video", str(path), "convert it, e.g. to PNG images")


def _check(video: cv2.VideoCapture, path: Path) -> None:
    width, height = (video.get(p) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    PIXELS.check(int(min(3 * width * height, 2**50)), path)
    if _tag(video)[0] == _BAYER:
        raise InputError("is a raw Bayer mosaic", str(path), "convert it to colour")


def _note(video: cv2.VideoCapture, path: Path) -> str:
    notes = []
    video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    turn = round(video.get(cv2.CAP_PROP_ORIENTATION_META)) % 360
    if turn:
        notes.append(
            f"is turned by {turn} degrees, as its orientation tag says; the camera matrix must be "
            "of images turned likewise"
        )
    deep = bits(_tag(video))
    if deep > 8:
        notes.append(f"has {deep} bits a sample, of which 8 are read; PNG images keep all")
    return f"{path}: {'; '.join(notes)}" if notes else ""


def _tag(video: Any) -> bytes:
    """Return the four bytes that name the format of the pixels, zeros if it is not known."""
    number = int(video.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT))
    return (number % 2**32).to_bytes(4, "little")


def bits(tag: bytes) -> int:
    """Return the bits of a sample, by the four bytes that name the format of the pixels."""
    if tag[:2] == b"P0":
        return int(tag[2:]) if tag[2:].isdigit() else 8
    return next((byte for byte in (tag[3], tag[0]) if byte in _DEEP), 8)

"""Pictures as PNG files."""

from pathlib import Path
from typing import Any

import cv2
from numpy.typing import NDArray

from .files import atomic_path


def write_png(path: str | Path, image: NDArray[Any]) -> None:
    """Write (H, W) or (H, W, 3) pixels of 8 or 16 bits, blue first as OpenCV has them.

    Encoded in memory: OpenCV's own writer reports a full disk by its return value, and libpng by a
    line of its own.

    Raises:
        InputError: the file cannot be written.
    """
    encoded, data = cv2.imencode(".png", image)
    if not encoded:
        raise ValueError(f"an image of shape {image.shape} cannot be a PNG")
    with atomic_path(path) as aside:
        aside.write_bytes(data.tobytes())

"""Photographs from which maps were decoded, kept beside the result for its report."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.image_files import read_image
from ..files import atomic_path
from ..reading.regular import is_file

_QUALITY = 92
"""Of JPEG, 0 to 100. Chosen: for looking at; who measures has the original."""
_WHITE = 99.8
"""Percentile that becomes white, where an image is darker than its scale."""


def photograph_path(folder: Path, frame: str) -> Path:
    """Return where the photograph of a frame lies, the frame being called after its map."""
    return folder / f"{Path(frame).stem}_photograph.jpg"


def save_photograph(path: Path, image: NDArray[np.floating]) -> None:
    """Write an image (H, W, C), BGR or grey, 1 = full scale, brightened where it is dark.

    Raises:
        InputError: the file cannot be written.
    """
    with atomic_path(path) as aside:
        aside.write_bytes(_encoded(image))


def write_photographs(folder: Path, photographs: Mapping[str, NDArray[np.uint8]]) -> None:
    """Write those photographs, (H, W, 3) RGB by the frame's name, that a folder does not hold yet.

    Raises:
        InputError: a file cannot be written.
    """
    for name in photographs:
        path = photograph_path(folder, name)
        if path.exists():
            continue
        folder.mkdir(exist_ok=True)
        if isinstance(photographs, KeptPhotographs):
            photographs.write(path, name)
        else:
            save_photograph(path, np.asarray(photographs[name][..., ::-1] / np.float32(255)))


def _encoded(image: NDArray[np.floating]) -> bytes:
    white = max(float(np.percentile(image, _WHITE)), 1e-3)
    pixels = np.round(255 * np.clip(image / min(white, 1.0), 0, 1)).astype(np.uint8)
    pixels = np.ascontiguousarray(np.broadcast_to(pixels[..., :3], (*pixels.shape[:2], 3)))
    done, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert done  # OpenCV's wheels hold the encoder
    return data.tobytes()


class KeptPhotographs(Mapping[str, NDArray[np.uint8]]):
    """Photographs in memory as JPEG, each decoded when it is asked for."""

    def __init__(self) -> None:
        self._files: dict[str, bytes] = {}

    def keep(self, name: str, image: NDArray[np.floating]) -> None:
        """Keep a frame's image (H, W, C), BGR or grey, 1 = full scale."""
        self._files[name] = _encoded(image)

    def write(self, path: Path, name: str) -> None:
        """Write a frame's photograph as JPEG.

        Raises:
            InputError: the file cannot be written.
        """
        with atomic_path(path) as aside:
            aside.write_bytes(self._files[name])

    def __getitem__(self, name: str) -> NDArray[np.uint8]:
        pixels = cv2.imdecode(np.frombuffer(self._files[name], np.uint8), cv2.IMREAD_COLOR)
        return np.asarray(pixels, np.uint8)[..., ::-1]

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __len__(self) -> int:
        return len(self._files)


class StoredPhotographs(Mapping[str, NDArray[np.uint8]]):
    """The photographs that lie in a folder, each read when it is asked for."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        """Look for the photographs of frames, by their names."""
        paths = {name: photograph_path(folder, name) for name in names}
        self._paths = {name: path for name, path in paths.items() if is_file(path)}

    def __getitem__(self, name: str) -> NDArray[np.uint8]:
        pixels = read_image(self._paths[name])
        return np.broadcast_to(pixels[..., ::-1], (*pixels.shape[:2], 3)).astype(np.uint8)

    def __iter__(self) -> Iterator[str]:
        return iter(self._paths)

    def __len__(self) -> int:
        return len(self._paths)

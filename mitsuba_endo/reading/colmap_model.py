"""COLMAP's sparse models, text or binary: cameras and the poses of images.

Format: https://colmap.github.io/format.html. Points are not read.
"""

import re
import struct
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from .regular import MESH, is_file, read_bytes, read_text

_MODELS = (
    ("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8), ("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5), ("THIN_PRISM_FISHEYE", 12),
)  # fmt: skip
"""Names and numbers of parameters by the binary files' model number (``src/colmap/sensor``)."""
_POINT_BYTES = 24
"""Of an image's point: two doubles and the number of a 3D point."""
_TODO = "export the model again"


@dataclass(frozen=True)
class ModelImage:
    """Pose of one image."""

    quaternion: tuple[float, float, float, float]
    """(x, y, z, w) of camera_from_world."""
    t: tuple[float, float, float]
    camera: str
    """Number of its camera."""
    name: str


@dataclass(frozen=True)
class SparseModel:
    """Cameras, one line of ``cameras.txt`` each by their numbers, and images."""

    cameras: dict[str, str]
    images: list[ModelImage]


def is_model(folder: Path) -> bool:
    """Tell whether a folder holds a model."""
    return folder.is_dir() and any(
        is_file(folder / f"cameras{s}") and is_file(folder / f"images{s}") for s in (".txt", ".bin")
    )


def read_model(folder: Path) -> SparseModel:
    """Read a model; binary files count where both kinds lie there.

    Raises:
        InputError: a file is missing or damaged.
    """
    if is_file(folder / "cameras.bin"):
        cameras, images = folder / "cameras.bin", folder / "images.bin"
        return SparseModel(_binary_cameras(cameras), _binary_images(images))
    cameras, images = folder / "cameras.txt", folder / "images.txt"
    return SparseModel(_text_cameras(cameras), _text_images(images))


def _text_cameras(path: Path) -> dict[str, str]:
    lines = read_text(path, MESH, _TODO).splitlines()
    return {line.split()[0]: line for line in lines if re.match(r"\s*\d", line)}


def _text_images(path: Path) -> list[ModelImage]:
    """Read every second line: the other is of an image's points, and may be empty."""
    lines = [ln for ln in read_text(path, MESH, _TODO).splitlines() if not ln.startswith("#")]
    images = []
    for line in lines[::2]:
        parts = line.split(maxsplit=9)
        if not parts:
            continue
        try:
            w, x, y, z, *t = (float(p) for p in parts[1:8])
            images.append(ModelImage((x, y, z, w), (t[0], t[1], t[2]), parts[8], parts[9].strip()))
        except (ValueError, IndexError):
            raise InputError("is no list of images", str(path), _TODO) from None
    return images


class _Bytes:
    """Numbers of a binary file, one after the other."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, read_bytes(path, MESH, todo=_TODO), 0

    def take(self, form: str) -> tuple[float, ...]:
        try:
            values = struct.unpack_from(f"<{form}", self.data, self.at)
        except (struct.error, OverflowError):
            raise InputError("ends too early", str(self.path), _TODO) from None
        self.at += struct.calcsize(f"<{form}")
        return values

    def count(self) -> int:
        return int(self.take("Q")[0])

    def name(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise InputError("ends within a name", str(self.path), _TODO)
        name, self.at = self.data[self.at : end].decode("utf-8", "replace"), end + 1
        return name


def _binary_cameras(path: Path) -> dict[str, str]:
    data, cameras = _Bytes(path), {}
    for _ in range(data.count()):
        number, kind, width, height = (int(v) for v in data.take("IiQQ"))
        if not 0 <= kind < len(_MODELS):
            raise InputError(f"holds a camera model of number {kind}", str(path), _TODO)
        name, count = _MODELS[kind]
        values = " ".join(repr(v) for v in data.take(f"{count}d"))
        cameras[str(number)] = f"{number} {name} {width} {height} {values}"
    return cameras


def _binary_images(path: Path) -> list[ModelImage]:
    data, images = _Bytes(path), []
    for _ in range(data.count()):
        _, w, x, y, z, tx, ty, tz, camera = data.take("I7dI")
        name = data.name()
        points = data.count()
        data.at += points * _POINT_BYTES
        images.append(ModelImage((x, y, z, w), (tx, ty, tz), str(int(camera)), name))
    return images

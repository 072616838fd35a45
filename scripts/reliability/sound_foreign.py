"""Small calibrations, maps and images as other programs write them."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

WIDTH, HEIGHT = 24, 14
LENSES = {"1": (24, 14, (30.0, 31.0, 11.5, 7.5, -0.1, 0.02, 0.0, 0.0)),
          "2": (240, 120, (300.0, 300.0, 118.0, 61.0, 0.0, 0.0, 0.0, 0.0))}  # fmt: skip
"""Size and OpenCV's parameters of COLMAP's cameras."""
PLACES = {
    "a.png": ("1", (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
    "projector/a.png": ("2", (0.99, 0.05, -0.1, 0.02, -6.0, 1.4, 0.5)),
    "b.png": ("1", (1.0, 0.0, 0.01, 0.0, 1.0, 0.2, 0.1)),
    "projector/b.png": ("2", (0.99, 0.05, -0.09, 0.02, -5.0, 1.5, 0.6)),
}
"""Camera, quaternion w x y z and translation of COLMAP's images."""
OPENCV = 4
"""COLMAP's number of the model."""
TURN = 6
"""EXIF's orientation: by 90 degrees."""


def _calibrations(folder: Path) -> None:
    import cv2

    entries: dict[str, Any] = {
        "image_width": WIDTH, "image_height": HEIGHT,
        "camera_matrix": np.array([[30.0, 0, 11.0], [0, 31.0, 7.0], [0, 0, 1]]),
        "distortion_coefficients": np.array([[-0.1, 0.02, 0.0, 0.0, 0.0]]),
        "projector_law": "pinhole", "projector_width": 240, "projector_height": 120,
        "projector_matrix": np.array([[300.0, 0, 118.0], [0, 303.0, 61.0], [0, 0, 1]]),
        "R": cv2.Rodrigues(np.array([0.1, -0.2, 0.05]))[0], "T": np.array([[-6.0], [1.4], [0.5]]),
    }  # fmt: skip
    for suffix in ("yml", "xml", "json"):
        storage = cv2.FileStorage(str(folder / f"stereo.{suffix}"), cv2.FILE_STORAGE_WRITE)
        for name, value in entries.items():
            storage.write(name, value)
        storage.release()
    for form, write in (("text", _colmap_text), ("binary", _colmap_binary)):
        (folder / f"colmap_{form}").mkdir()
        write(folder / f"colmap_{form}")


def _colmap_text(folder: Path) -> None:
    cameras = [f"{n} OPENCV {w} {h} {' '.join(map(str, p))}\n" for n, (w, h, p) in LENSES.items()]
    images = [
        f"{k} {' '.join(map(str, place))} {camera} {name}\n\n"
        for k, (name, (camera, place)) in enumerate(PLACES.items(), 1)
    ]
    (folder / "cameras.txt").write_text("# Cameras\n" + "".join(cameras), encoding="utf-8")
    (folder / "images.txt").write_text("# Images\n" + "".join(images), encoding="utf-8")


def _colmap_binary(folder: Path) -> None:
    cameras, images = struct.pack("<Q", len(LENSES)), struct.pack("<Q", len(PLACES))
    for number, (width, height, values) in LENSES.items():
        cameras += struct.pack("<IiQQ8d", int(number), OPENCV, width, height, *values)
    for k, (name, (camera, place)) in enumerate(PLACES.items(), 1):
        images += struct.pack("<I7dI", k, *place, int(camera)) + name.encode() + b"\0"
        images += struct.pack("<Q2dq", 1, 3.0, 4.0, -1)
    (folder / "cameras.bin").write_bytes(cameras)
    (folder / "images.bin").write_bytes(images)


def _maps(folder: Path) -> None:
    import OpenEXR

    from .sound import sound

    (folder / "rig.yaml").write_bytes((sound("inputs") / "rig.yaml").read_bytes())
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    u, v = 9 * x + 5, 8 * y + 3
    np.save(folder / "map.npy", np.stack([u, v], -1))
    np.savez(folder / "pair.npz", x_map=u, y_map=v, mask=np.ones(u.shape, bool))
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    parts = [
        OpenEXR.Part({**header}, {"Y": u}, "picture"),
        OpenEXR.Part({**header}, {"pattern.u": u, "pattern.v": v}, "coordinates"),
    ]
    OpenEXR.File(parts).write(str(folder / "parts.exr"))


def _images(folder: Path) -> None:
    import cv2

    image = np.random.default_rng(1).integers(0, 255, (40, 60, 3)).astype(np.uint8)
    cv2.imwrite(str(folder / "a.webp"), image)
    cv2.imwritemulti(str(folder / "pages.tif"), [image, image[::-1]])
    jpeg, png, tiff = (cv2.imencode(s, image)[1].tobytes() for s in (".jpg", ".png", ".tif"))
    block = _exif()
    segment = b"Exif\0\0" + block
    mark = b"\xff\xe1" + struct.pack(">H", 2 + len(segment)) + segment
    (folder / "turned.jpg").write_bytes(jpeg[:2] + mark + jpeg[2:])
    chunk = b"eXIf" + block
    chunk = struct.pack(">I", len(block)) + chunk + struct.pack(">I", zlib.crc32(chunk))
    end = png.rindex(b"IDAT") - 4
    (folder / "turned.png").write_bytes(png[:end] + chunk + png[end:])
    (folder / "turned.tif").write_bytes(_with_orientation(tiff))


def _exif() -> bytes:
    """Return a TIFF file of one directory that holds the orientation alone."""
    return struct.pack("<2sHIHHHIHHI", b"II", 42, 8, 1, 274, 3, 1, TURN, 0, 0)


def _with_orientation(tiff: bytes) -> bytes:
    """Put a directory with one more entry at the end of a TIFF file of OpenCV."""
    (at,) = struct.unpack("<I", tiff[4:8])
    (count,) = struct.unpack("<H", tiff[at : at + 2])
    old = tiff[at + 2 : at + 2 + 12 * count]
    entries = [old[k : k + 12] for k in range(0, len(old), 12) if old[k : k + 2] != b"\x12\x01"]
    entries.append(struct.pack("<HHIHH", 274, 3, 1, TURN, 0))
    padded = tiff + b"\0" * (len(tiff) % 2)
    entries.sort(key=lambda entry: struct.unpack("<H", entry[:2]))
    directory = struct.pack("<H", len(entries)) + b"".join(entries) + bytes(4)
    return padded[:4] + struct.pack("<I", len(padded)) + padded[8:] + directory


FOREIGN = {"calibrations": _calibrations, "foreign maps": _maps, "tagged images": _images}
"""Makers by the names of what they make."""

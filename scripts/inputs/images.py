"""Photographs and videos as cameras and other programs store them."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from mitsuba_endo.decoding.image_files import read_frames

from .case import REFUSED, RIGHT, WARNED, Case, Ending

PICTURE = cv2.resize(
    np.random.default_rng(0).integers(0, 256, (5, 8), np.uint8), (64, 40),
    interpolation=cv2.INTER_CUBIC,
)  # fmt: skip
"""Smooth, so that JPEG leaves it as it is."""
LEVELS = 4.0
"""Gray levels of 255 by which a picture may differ in the mean: a lossy video's."""


def case(
    brings: str,
    name: str,
    write: Callable[[Path], object],
    expected: str = RIGHT,
    says: str = "",
    upright: Callable[[np.ndarray], np.ndarray] = lambda image: image,
) -> Case:
    """Return a case of a picture that shows ``upright(PICTURE)``."""

    def run(folder: Path) -> Ending:
        write(folder / name)
        frames = list(read_frames([folder / (name.split("/")[0] if "/" in name else name)]))
        wanted = upright(PICTURE) / 255
        apart = [
            np.abs(frame.image.mean(-1) - wanted).mean() * 255 / LEVELS
            if frame.image.shape[:2] == wanted.shape else np.inf
            for frame in frames
        ]  # fmt: skip
        return Ending(float(max(apart)), sorted({frame.note for frame in frames} - {""}))

    return Case("image", brings, expected, says, run)


def pillow(turn: int = 1, pages: int = 1, **options: object) -> Callable[[Path], object]:
    exif = Image.Exif()
    exif[274] = turn

    def write(path: Path) -> None:
        image = Image.fromarray(PICTURE).convert("RGB")
        rest = [Image.fromarray(np.roll(PICTURE, k + 1)).convert("RGB") for k in range(pages - 1)]
        more = {"save_all": True, "append_images": rest} if rest else {}
        image.save(path, exif=exif, **more, **options)  # type: ignore[arg-type]

    return write


def opencv(image: np.ndarray) -> Callable[[Path], object]:
    return lambda path: cv2.imwrite(str(path), image)


def video(codec: str, depth: int, turned: bool = False) -> Callable[[Path], object]:
    def write(path: Path) -> None:
        colour = codec != "FFV1"
        kind = [cv2.VIDEOWRITER_PROP_DEPTH, depth, cv2.VIDEOWRITER_PROP_IS_COLOR, int(colour)]
        code, size = cv2.VideoWriter.fourcc(*codec), (PICTURE.shape[1], PICTURE.shape[0])
        writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, 10, size, kind)
        frame = PICTURE if depth == cv2.CV_8U else PICTURE.astype(np.uint16) * 257
        writer.write(np.dstack([frame] * 3) if colour else frame)
        writer.release()
        if turned:
            _turn(path)

    return write


def _turn(path: Path) -> None:
    """Write a half turn into the matrix of an MP4 file's track."""
    data = path.read_bytes()
    one, minus = (0x10000).to_bytes(4, "big"), (0xFFFF0000).to_bytes(4, "big")
    zeros, unit = bytes(12), (0x40000000).to_bytes(4, "big")
    at = data.index(one + zeros + one + zeros + unit, data.index(b"tkhd"))
    turned = minus + zeros + minus + zeros + unit
    path.write_bytes(data[:at] + turned + data[at + len(turned) :])


def _mosaic(path: Path) -> None:
    Image.fromarray(PICTURE).save(path)
    data = path.read_bytes()
    at = data.index(b"\x06\x01\x03\0\x01\0\0\0") + 8  # TIFF's tag of the colours
    path.write_bytes(data[:at] + b"\x23\x80" + data[at + 2 :])


def _beside_hidden(path: Path) -> None:
    path.parent.mkdir()
    cv2.imwrite(str(path), PICTURE)
    (path.parent / f"._{path.name}").write_bytes(b"\0\5\x16\7")


CASES = [
    case("PNG of 16 bits, 12 of them used", "a.png", opencv(PICTURE.astype(np.uint16) * 16)),
    case("JPEG, EXIF says: turned by 90 degrees", "a.jpg", pillow(6, quality=98), WARNED,
         "orientation tag", lambda image: np.rot90(image, -1)),
    case("PNG, EXIF says: mirrored", "a.png", pillow(2), WARNED, "orientation tag", np.fliplr),
    case("TIFF, turned by 180 degrees", "a.tif", pillow(3), WARNED, "orientation tag",
         lambda image: image[::-1, ::-1]),
    case("MP4, its track is turned by 180 degrees", "a.mp4", video("mp4v", cv2.CV_8U, turned=True),
         WARNED, "orientation tag", lambda image: image[::-1, ::-1]),
    case("WebP", "a.webp", pillow(lossless=True)),
    case("WebP, animated", "a.webp", pillow(pages=3, lossless=True), REFUSED, "holds 3 images"),
    case("TIFF of floats from 0 to 1", "a.tif", opencv(PICTURE.astype(np.float32) / 255)),
    case("TIFF of floats from 0 to 255", "a.tif", opencv(PICTURE.astype(np.float32)), REFUSED,
         "holds floats from"),
    case("TIFF of raw values under a Bayer filter", "a.tif", _mosaic, REFUSED, "Bayer"),
    case("video of 16 bits a sample", "a.mkv", video("FFV1", cv2.CV_16U), WARNED, "has 16 bits"),
    case("PNG with an alpha channel", "a.png",
         opencv(np.dstack([PICTURE] * 3 + [np.full_like(PICTURE, 200)]))),
    case("a folder with macOS's hidden files", "in/a.png", _beside_hidden),
]  # fmt: skip

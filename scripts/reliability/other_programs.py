"""Readers of what other programs write: calibrations, maps and images."""

from pathlib import Path

from . import mutations
from .reader import Reader, Use, made

BYTES, TEXT, ARRAYS = mutations.OF_BYTES, mutations.OF_TEXT, mutations.OF_ARRAYS
TAGGED = ("turned.jpg", "turned.png", "turned.tif", "pages.tif", "a.webp")


def _calibration(name: str) -> Use:
    """Read a calibration as truth and as result."""

    def use(folder: Path) -> None:
        from mitsuba_endo.evaluate.truths import load_truths

        load_truths([folder / name])

    return use


def _map(name: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.cli.calibrate import load_input

        load_input([folder / name], folder / "rig.yaml")

    return use


def _image(name: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.decoding.image_files import read_frames

        for _ in read_frames([folder / name]):
            pass

    return use


FOREIGN_READERS = (
    *(Reader(f"calibration opencv {s}", made("calibrations"), f"stereo.{s}",
             _calibration(f"stereo.{s}"), TEXT, 0.7) for s in ("yml", "xml", "json")),
    *(Reader(f"calibration {name}", made("calibrations"), f"colmap_{form}/{name}",
             _calibration(f"colmap_{form}"), ways, 0.7)
      for form, name, ways in (
          ("text", "cameras.txt", TEXT), ("text", "images.txt", TEXT),
          ("binary", "cameras.bin", BYTES), ("binary", "images.bin", BYTES),
      )),
    Reader("map npy", made("foreign maps"), "map.npy", _map("map.npy"), BYTES, 0.7),
    Reader("map npz with x and y", made("foreign maps"), "pair.npz", _map("pair.npz"), ARRAYS, 0.7),
    Reader("map exr of parts", made("foreign maps"), "parts.exr", _map("parts.exr"), BYTES, 0.7),
    *(Reader(f"image {name}", made("tagged images"), name, _image(name), BYTES, 0.7)
      for name in TAGGED),
)  # fmt: skip

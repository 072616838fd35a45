"""Maps of other tools."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from mitsuba_endo.cli.calibrate import load_input
from mitsuba_endo.decoding.frame_files import frame_files
from mitsuba_endo.sanity.examine import examine

from .case import REFUSED, RIGHT, TOLD, WARNED, Case, Ending, beside
from .view import CAMERA, PATTERN, truth, write_rig

Array = NDArray[Any]
Write = Callable[[Path], object]
W, H = PATTERN
EXACT, ROUNDED = 1e-3, 0.51
"""Pattern pixels: of single precision, and of whole numbers."""


def read(
    folder: Path, paths: list[Path], words: str, mask: Path | None, most: float, gone: Array | None
) -> Ending:
    """Read maps as ``calibrate`` does before it solves anything."""
    files = frame_files(paths)
    maps, rig = load_input(files, write_rig(folder), convention=words, mask=mask)
    examined = examine(maps, rig)
    expected = truth() if gone is None else np.where(gone[..., None], np.nan, truth())
    errors = [beside(map_.q, expected, most) for map_ in examined.maps]
    if gone is not None and any(map_.valid[gone > 0].any() for map_ in examined.maps):
        errors.append(np.inf)
    if len({map_.name for map_ in maps}) < len(files):
        errors.append(np.inf)
    return Ending(max(errors), examined.warnings)


def case(
    brings: str,
    write: Write,
    name: str = "map.npy",
    *,
    words: str = "",
    expected: str = RIGHT,
    says: str = "",
    most: float = EXACT,
    mask: str = "",
    gone: Array | None = None,
    paths: tuple[str, ...] = (),
) -> Case:
    """Return a case of a map that ``write`` writes to ``name``, read with words and a mask."""

    def run(folder: Path) -> Ending:
        write(folder / name)
        given = [folder / path for path in paths or (name,)]
        return read(folder, given, words, folder / mask if mask else None, most, gone)

    options = f" with `--map-convention {words}`" if words else ""
    return Case("map", brings + options, expected, says, run)


def npy(array: Array) -> Write:
    return lambda path: np.save(path, array)


def npz(**arrays: Array) -> Write:
    return lambda path: np.savez(path, **arrays)  # pyright: ignore[reportArgumentType]


def exr(*parts: dict[str, Array], **header: object) -> Write:
    made = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **header}

    def write(path: Path) -> None:
        OpenEXR.File([
            OpenEXR.Part(made | {"name": f"part{k}"},
                         {n: np.ascontiguousarray(a) for n, a in part.items()})
            for k, part in enumerate(parts)
        ]).write(str(path))  # fmt: skip

    return write


def _several(path: Path) -> None:
    for folder in "ab":
        (path / folder).mkdir(parents=True)
        np.save(path / folder / "map.npy", truth())


def _tool() -> NDArray[np.bool_]:
    """The pixels of a tool."""
    x, y = np.meshgrid(np.arange(CAMERA[0]), np.arange(CAMERA[1]))
    return (x > 200) & (y > 150)


def _masked(*names: str) -> Write:
    def write(path: Path) -> None:
        np.save(path, truth())
        for name in names:
            target = path.parent / name
            target.parent.mkdir(exist_ok=True)
            cv2.imwrite(str(target), np.uint8(255) * ~_tool())

    return write


def _small_mask(path: Path) -> None:
    np.save(path, truth())
    cv2.imwrite(str(path.parent / "small.png"), np.uint8(255) * ~_tool()[::2, ::2])


T = truth()
X, Y = T[..., 0], T[..., 1]
HOLES = np.isnan(X)
COLOURS: dict[str, Array] = {"R": X / W, "G": Y / H, "B": X / W}
NORMALISED = (T + 0.5) / PATTERN


def signed(value: float) -> Array:
    return np.where(HOLES[..., None], np.float32(value), T)


CASES = [
    case("npz, array `map`", npz(map=T), "map.npz"),
    case("npz, one array of another name", npz(correspondences=T), "map.npz"),
    case("npz, `map_x` and `map_y`", npz(map_x=X, map_y=Y), "map.npz"),
    case("npz, `col` and `row`, and others", npz(col=X, row=Y, valid=~HOLES), "map.npz"),
    case("npz, `a` and `b`", npz(a=X, b=Y), "map.npz", expected=REFUSED, says="channels=X/Y"),
    case("npz, `a` and `b`", npz(a=X, b=Y), "map.npz", words="channels=a/b"),
    case("npy, height x width x 2", npy(T)),
    case("npy, 2 x height x width, big-endian doubles", npy(np.moveaxis(T, -1, 0).astype(">f8"))),
    case("npy, half precision", npy(T.astype(np.float16)), expected=WARNED, says="half precision",
         most=0.1),
    case("npy, 16-bit whole numbers, 65535 = missing",
         npy(np.where(HOLES[..., None], 65535, np.rint(np.nan_to_num(T))).astype(np.uint16)),
         expected=WARNED, says="(65535, 65535)", most=ROUNDED),
    case("npy, 8-bit numbers", npy(np.nan_to_num(T).astype(np.uint8)), expected=REFUSED,
         says="too small for pattern pixels"),
    case("npy, three channels", npy(np.dstack([T, ~HOLES])), expected=REFUSED, says="260x340x3"),
    case("npy, a list of points", npy(T.reshape(-1, 2)), expected=REFUSED, says="88400x2"),
    case("csv of points", lambda path: path.write_text("1,2\n"), "map.csv", expected=REFUSED,
         says="unknown kind of map '.csv'"),
    case("OpenEXR", exr({"projector.x": X, "projector.y": Y}), "map.exr"),
    case("OpenEXR of two parts, the second one holds it",
         exr(COLOURS, {"projector.x": X, "projector.y": Y}), "map.exr"),
    case("OpenEXR, channels of a layer, capitals",
         exr(COLOURS | {"ViewLayer.projector.X": X, "ViewLayer.projector.Y": Y}), "map.exr"),
    case("OpenEXR, `u` and `v`", exr({"u": X, "v": Y}), "map.exr"),
    case("OpenEXR, red and green", exr({"R": X, "G": Y, "B": X}), "map.exr", expected=REFUSED,
         says="channel projector.x is missing among 'B, G, R'"),
    case("OpenEXR, red and green", exr({"R": X, "G": Y, "B": X}), "map.exr", words="channels=R/G"),
    case("OpenEXR, half precision",
         exr({"projector.x": X.astype(np.float16), "projector.y": Y.astype(np.float16)}),
         "map.exr", expected=WARNED, says="half precision", most=0.1),
    case("OpenEXR, compressed with loss (DWAA)",
         exr({"projector.x": X, "projector.y": Y}, compression=OpenEXR.DWAA_COMPRESSION), "map.exr",
         expected=REFUSED, says="compressed with loss"),
    case("OpenEXR, empty border cut off",
         exr({"projector.x": X[3:, 5:], "projector.y": Y[3:, 5:]},
             dataWindow=(np.array([5, 3], np.int32), np.array([339, 259], np.int32)),
             displayWindow=(np.array([0, 0], np.int32), np.array([339, 259], np.int32))),
         "map.exr"),
    case("counted from 1", npy(T + 1), expected=TOLD, says="counted from 1", most=1.01),
    case("counted from 1", npy(T + 1), words="one-based"),
    case("counted from the first pixel's corner", npy(T + 0.5), words="corner-based"),
    case("normalised by the pattern's size", npy(NORMALISED), expected=REFUSED,
         says="--map-convention normalised"),
    case("normalised by the pattern's size", npy(NORMALISED), words="normalised"),
    case("normalised, and 65535 = missing",
         npy(np.where(HOLES[..., None], 65535, NORMALISED).astype(np.float32)), expected=REFUSED,
         says="normalised by the pattern's size"),
    case("from 0 to 1 between centres", npy(T / (W - 1, H - 1)), words="normalised-centres"),
    case("from -1 to 1", npy(2 * NORMALISED - 1), expected=REFUSED, says="normalised,signed"),
    case("from -1 to 1", npy(2 * NORMALISED - 1), words="normalised,signed"),
    case("y before x", npy(T[..., ::-1]), expected=REFUSED, says="swapped"),
    case("y before x", npy(T[..., ::-1]), words="swapped"),
    case("indexed by column and row", npy(T.swapaxes(0, 1)), expected=REFUSED,
         says="the map is 260 x 340 pixels"),
    case("indexed by column and row", npy(T.swapaxes(0, 1)), words="transposed"),
    case("x from the right", npy(np.stack([W - 1 - X, Y], -1)), expected=REFUSED, says="mirrored"),
    case("x from the right", npy(np.stack([W - 1 - X, Y], -1)), words="x-mirrored"),
    case("y upwards", npy(np.stack([X, H - 1 - Y], -1)), expected=REFUSED, says="y runs upwards"),
    case("y upwards", npy(np.stack([X, H - 1 - Y], -1)), words="y-upwards"),
    case("MATLAB: from 1, y upwards, y first", npy(np.stack([H - Y, X + 1], -1)),
         words="one-based,swapped,y-upwards"),
    case("0 = missing", npy(signed(0)), expected=WARNED, says="(0, 0)"),
    case("-1 = missing", npy(signed(-1)), expected=WARNED, says="(-1, -1)"),
    case("-1 = missing", npy(signed(-1)), words="missing=-1"),
    case("a folder of maps, and pictures beside", _masked("map_graph.png"), paths=(".",)),
    case("two maps of one name in two folders", _several, "frames",
         paths=("frames/a/map.npy", "frames/b/map.npy")),
    case("a mask for all frames", _masked("tool.png"), mask="tool.png", gone=_tool()),
    case("a folder of masks by the frames' names", _masked("masks/map_mask.png"), mask="masks",
         gone=_tool()),
    case("a folder of masks of other frames", _masked("masks/other.png"), mask="masks",
         expected=REFUSED, says="holds no mask of frame map.npy"),
    case("a mask of another size", _small_mask, mask="small.png", expected=REFUSED,
         says="the mask is 170 x 130 pixels"),
]  # fmt: skip

"""Every reader of the package with a sound file for it, made here, and what is done with the file.

What is done goes as far as a command goes that reads the file, short of solving and rendering.
"""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import mutations
from .mutations import Mutate

Use = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """A file to be spoilt, and who reads it."""

    name: str
    make: Callable[[Path], None]
    """Writes sound files into a folder."""
    file: str
    """The one of them that is spoilt."""
    use: Use
    """Reads the folder's files; raises ``InputError`` or returns."""
    ways: Sequence[Mutate]
    share: float = 1.0
    """How often it is tried, relative to others."""


def cli(*arguments: object) -> None:
    """Run a command in this process.

    Raises:
        RuntimeError: the exit code is not documented for what a user can mend.
    """
    from typer.testing import CliRunner

    from mitsuba_endo.cli.main import app

    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exit_code not in (0, 1, 2, 3):
        raise RuntimeError(f"exit code {result.exit_code}: {result.stderr.strip()[-400:]}")
    lines = [line for line in result.stderr.splitlines() if not line.startswith("[ ")]
    if result.exit_code == 2 and len(lines) != 1:
        raise RuntimeError(f"{len(lines)} lines: {result.stderr[:400]}")


def _made(name: str) -> Callable[[Path], None]:
    """Return a maker that copies what :mod:`.sound` made once for all."""
    from .sound import sound

    def make(folder: Path) -> None:
        shutil.copytree(sound(name), folder, dirs_exist_ok=True)

    return make


def _input(map_: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.cli.calibrate import load_input

        load_input([folder / map_], folder / "rig.yaml")

    return use


def _camera(name: str) -> Use:
    def use(folder: Path) -> None:
        _input("map.npz")(folder / name)

    return use


def _folder(folder: Path) -> None:
    """Read a solution folder whole, and what the viewer makes of it first."""
    from mitsuba_endo.show.read_folder import read_solution_folder
    from mitsuba_endo.show.result_scene import ResultScene
    from mitsuba_endo.show.solution_values import headline

    calibration = read_solution_folder(folder)
    scene = ResultScene(calibration)
    scene.quantities()
    headline(calibration.solution)
    for k in range(len(calibration.frames)):
        scene.rays(k)


def _report(folder: Path) -> None:
    cli("report", folder, "--out", folder / "new.html")


def _evaluate(folder: Path) -> None:
    cli("evaluate", folder, "--truth", folder / "truth.json", "--out", folder / "new.json")


def _exports(folder: Path) -> None:
    for name, out in (("ply", "a.ply"), ("opencv", "a.yml"), ("mitsuba", "m"), ("colmap", "c")):
        cli("export", folder, "--format", name, "--out", folder.parent / f"exports/{out}")


def _checkpoint(folder: Path) -> None:
    from mitsuba_endo.records.checkpoint import load_checkpoint

    load_checkpoint(folder)


def _frames(name: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.decoding.image_files import read_frames

        for _ in read_frames([folder / name]):
            pass

    return use


def _network(engine: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.decoding.network import describe, load_network

        path = folder / "decoder.onnx"
        # With a checksum that is right: it is what the file holds that is to be refused.
        path.with_suffix(".json").write_text(describe(path.read_bytes(), {}), encoding="utf-8")
        network = load_network(path, engine)  # type: ignore[arg-type]
        network.heads(np.zeros((40, 48), np.uint8))

    return use


def _scene(folder: Path) -> None:
    from mitsuba_endo.rendering.scene import load_scene

    load_scene(folder / "scene.xml")


def _surface(name: str) -> Use:
    def use(folder: Path) -> None:
        from mitsuba_endo.records.surface import load_surface

        load_surface(folder / name)

    return use


def _config(folder: Path) -> None:
    from mitsuba_endo.dataset.config import load_config

    load_config(folder / "config.yaml")


def _dataset(folder: Path) -> None:
    from mitsuba_endo.dataset.contact_sheet import write_contact_sheets
    from mitsuba_endo.dataset.reader import Dataset

    write_contact_sheets(Dataset(folder))


def _go_on(folder: Path) -> None:
    """Go on with a dataset of which nothing is missing."""
    from mitsuba_endo.dataset.config import load_config
    from mitsuba_endo.dataset.run import make_dataset

    def no_pool(job: Any) -> Any:
        raise RuntimeError("a whole dataset has nothing left to make")

    try:
        make_dataset(load_config(folder / "config.yaml"), folder, 2, no_pool)
    except RuntimeError as error:
        if "nothing left" not in str(error):
            raise


def _mark(folder: Path) -> None:
    from mitsuba_endo.folder_mark import Kind
    from mitsuba_endo.outputs import prepare_folder

    prepare_folder(folder, Kind.CALIBRATION)


BYTES, TEXT = mutations.OF_BYTES, mutations.OF_TEXT
TREES, ARRAYS = mutations.OF_TREES, mutations.OF_ARRAYS
_IMAGES = ("a.png", "gray.png", "a.jpg", "a.tif", "a.bmp", "a.ppm")

READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        Reader("rig", _made("inputs"), "rig.yaml", _input("map.npz"), TREES, 2),
        Reader("camera yaml", _made("camera yaml"), "camera.yaml", _input("map.npz"), TEXT),
        Reader("camera xml", _made("camera xml"), "camera.xml", _input("map.npz"), TEXT),
        Reader("camera json", _made("camera json"), "camera.json", _input("map.npz"), TREES),
        *(Reader(f"camera {n}", _made("cameras"), f"{n}/{n}.{suffix}", _camera(n), TEXT, 0.5)
          for n, suffix in (("kalibr", "yaml"), ("ros", "yaml"), ("colmap", "txt"))),
        Reader("map exr", _made("inputs"), "map.exr", _input("map.exr"), BYTES, 2),
        Reader("map npz", _made("inputs"), "map.npz", _input("map.npz"), ARRAYS, 2),
        Reader("solution folder", _made("result"), "solution.json", _folder, TREES, 1),
        Reader("report of solution", _made("result"), "solution.json", _report, TREES, 0.2),
        Reader("solution evaluate", _made("result"), "solution.json", _evaluate, TREES, 2),
        Reader("solution export", _made("result"), "solution.json", _exports, TREES, 1),
        Reader("truth", _made("result"), "truth.json", _evaluate, TREES, 2),
        Reader("surface evaluate", _made("result"), "surface.ply", _evaluate, BYTES),
        Reader("surface export", _made("result"), "surface.ply", _exports, BYTES, 0.5),
        Reader("surface folder", _made("result"), "surface.ply", _folder, BYTES, 0.5),
        Reader("report of surface", _made("result"), "surface.ply", _report, BYTES, 0.1),
        Reader("observed", _made("result"), "observed_00_run_a.exr", _folder, BYTES, 0.5),
        Reader("history", _made("result"), "history.npz", _folder, ARRAYS),
        Reader("modes", _made("result"), "surface_modes.npz", _folder, ARRAYS, 0.5),
        Reader("trace", _made("result"), "trace.csv", _folder, TEXT, 0.5),
        Reader("checkpoint", _made("result"), "state.npz", _checkpoint, ARRAYS),
        *(Reader(f"image {n}", _made("images"), n, _frames(n), BYTES) for n in _IMAGES),
        Reader("video", _made("images"), "a.avi", _frames("a.avi"), BYTES, 0.5),
        Reader("mesh ply", _made("meshes"), "a.ply", _surface("a.ply"), BYTES),
        Reader("mesh ascii", _made("meshes"), "ascii.ply", _surface("ascii.ply"), TEXT),
        Reader("mesh stl", _made("meshes"), "a.stl", _surface("a.stl"), BYTES),
        Reader("mesh obj", _made("meshes"), "a.obj", _surface("a.obj"), TEXT),
        Reader("mesh off", _made("meshes"), "a.off", _surface("a.off"), TEXT, 0.5),
        Reader("mesh glb", _made("meshes"), "a.glb", _surface("a.glb"), BYTES, 0.5),
        Reader("network opencv", _made("network"), "decoder.onnx", _network("opencv"), BYTES, 0.15),
        Reader("network onnxruntime", _made("network"), "decoder.onnx", _network("onnxruntime"),
               BYTES, 0.15),
        Reader("scene", _made("scene"), "scene.xml", _scene, TEXT),
        Reader("scene mesh", _made("scene"), "surface.ply", _scene, BYTES),
        Reader("dataset configuration", _made("dataset files"), "config.yaml", _config, TREES, 2),
        Reader("dataset record", _made("dataset files"), "dataset.json", _go_on, TREES),
        Reader("sample description", _made("dataset files"), "samples/000001/sample.json", _dataset,
               TREES),
        Reader("sample image", _made("dataset files"), "samples/000001/image.png", _dataset, BYTES,
               0.5),
        Reader("sample map", _made("dataset files"), "samples/000001/grid.exr", _dataset, BYTES,
               0.5),
        Reader("shard", _made("dataset hdf5"), "shards/000000.h5", _dataset, BYTES, 2),
        Reader("mark", _made("result"), ".mitsuba-endo", _mark, TREES, 0.5),
    )
}  # fmt: skip
"""By name."""

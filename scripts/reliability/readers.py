"""Every reader of the package with a sound file for it, made here, and what is done with the file.

What is done goes as far as a command goes that reads the file, short of solving and rendering.
"""

from pathlib import Path
from typing import Any

import numpy as np

from . import mutations
from .other_programs import FOREIGN_READERS
from .reader import Reader, Use, cli, made
from .sequence_readers import SEQUENCE_READERS


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
        Reader("rig", made("inputs"), "rig.yaml", _input("map.npz"), TREES, 2),
        Reader("camera yaml", made("camera yaml"), "camera.yaml", _input("map.npz"), TEXT),
        Reader("camera xml", made("camera xml"), "camera.xml", _input("map.npz"), TEXT),
        Reader("camera json", made("camera json"), "camera.json", _input("map.npz"), TREES),
        *(Reader(f"camera {n}", made("cameras"), f"{n}/{n}.{suffix}", _camera(n), TEXT, 0.5)
          for n, suffix in (("kalibr", "yaml"), ("ros", "yaml"), ("colmap", "txt"))),
        Reader("map exr", made("inputs"), "map.exr", _input("map.exr"), BYTES, 2),
        Reader("map npz", made("inputs"), "map.npz", _input("map.npz"), ARRAYS, 2),
        Reader("solution folder", made("result"), "solution.json", _folder, TREES, 1),
        Reader("report of solution", made("result"), "solution.json", _report, TREES, 0.2),
        Reader("solution evaluate", made("result"), "solution.json", _evaluate, TREES, 2),
        Reader("solution export", made("result"), "solution.json", _exports, TREES, 1),
        Reader("truth", made("result"), "truth.json", _evaluate, TREES, 2),
        Reader("surface evaluate", made("result"), "surface.ply", _evaluate, BYTES),
        Reader("surface export", made("result"), "surface.ply", _exports, BYTES, 0.5),
        Reader("surface folder", made("result"), "surface.ply", _folder, BYTES, 0.5),
        Reader("report of surface", made("result"), "surface.ply", _report, BYTES, 0.1),
        Reader("observed", made("result"), "observed_00_run_a.exr", _folder, BYTES, 0.5),
        Reader("history", made("result"), "history.npz", _folder, ARRAYS),
        Reader("modes", made("result"), "surface_modes.npz", _folder, ARRAYS, 0.5),
        Reader("trace", made("result"), "trace.csv", _folder, TEXT, 0.5),
        Reader("checkpoint", made("result"), "state.npz", _checkpoint, ARRAYS),
        *(Reader(f"image {n}", made("images"), n, _frames(n), BYTES) for n in _IMAGES),
        Reader("video", made("images"), "a.avi", _frames("a.avi"), BYTES, 0.5),
        Reader("mesh ply", made("meshes"), "a.ply", _surface("a.ply"), BYTES),
        Reader("mesh ascii", made("meshes"), "ascii.ply", _surface("ascii.ply"), TEXT),
        Reader("mesh stl", made("meshes"), "a.stl", _surface("a.stl"), BYTES),
        Reader("mesh obj", made("meshes"), "a.obj", _surface("a.obj"), TEXT),
        Reader("mesh off", made("meshes"), "a.off", _surface("a.off"), TEXT, 0.5),
        Reader("mesh glb", made("meshes"), "a.glb", _surface("a.glb"), BYTES, 0.5),
        Reader("network opencv", made("network"), "decoder.onnx", _network("opencv"), BYTES, 0.15),
        Reader("network onnxruntime", made("network"), "decoder.onnx", _network("onnxruntime"),
               BYTES, 0.15),
        Reader("scene", made("scene"), "scene.xml", _scene, TEXT),
        Reader("scene mesh", made("scene"), "surface.ply", _scene, BYTES),
        Reader("dataset configuration", made("dataset files"), "config.yaml", _config, TREES, 2),
        Reader("dataset record", made("dataset files"), "dataset.json", _go_on, TREES),
        Reader("sample description", made("dataset files"), "samples/000001/sample.json", _dataset,
               TREES),
        Reader("sample image", made("dataset files"), "samples/000001/image.png", _dataset, BYTES,
               0.5),
        Reader("sample map", made("dataset files"), "samples/000001/grid.exr", _dataset, BYTES,
               0.5),
        Reader("shard", made("dataset hdf5"), "shards/000000.h5", _dataset, BYTES, 2),
        Reader("mark", made("result"), ".mitsuba-endo", _mark, TREES, 0.5),
        *FOREIGN_READERS,
        *SEQUENCE_READERS,
    )
}  # fmt: skip
"""By name."""

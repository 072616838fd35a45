"""Sound files of every kind, small, made once in a folder that is given by the environment."""

import os
from pathlib import Path
from typing import Any

import numpy as np

from .sound_foreign import FOREIGN
from .sound_sequence import SEQUENCE

VARIABLE = "MITSUBA_ENDO_SOUND"
"""Folder in which the files are kept from one process to the next."""
WIDTH, HEIGHT = 24, 14
PATTERN = 240, 120


def sound(name: str) -> Path:
    """Return a folder with the files of one name, making them first if they are not there."""
    folder = Path(os.environ[VARIABLE]) / name.replace(" ", "_")
    if not folder.is_dir():
        making = folder.with_name(f"{folder.name}.making")
        making.mkdir(parents=True)
        MAKERS[name](making)
        making.rename(folder)
    return folder


def _rig(camera: Any = None) -> dict[str, Any]:
    return {
        "units": "mm",
        "camera": camera
        or {
            "model": "opencv", "width": WIDTH, "height": HEIGHT,
            "K": [[30.0, 0, 11.0], [0, 31.0, 7.0], [0, 0, 1]], "distortion": [-0.1, 0.02],
        },
        "projector": {
            "law": "pinhole", "width": PATTERN[0], "height": PATTERN[1], "focal": {"value": 300.0},
            "centre": [118.0, 61.0], "aspect": 1.01, "distortion": [0.01], "grid_period": 12.0,
            "pose": {"R": [0.1, -0.2, 0.05], "t": [-6.0, 1.4, 0.5]},
        },
        "scale": {"known_distance": {"pixels": [[2, 3], [10, 9]], "mm": 12.5, "std": 0.1}},
        "share": {"focal": "shared"},
        "drift": {"insertion_mm": 0.2},
    }  # fmt: skip


def _inputs(folder: Path, camera: Any = None) -> None:
    import yaml

    from mitsuba_endo.records.correspondence import save_map

    (folder / "rig.yaml").write_text(yaml.safe_dump(_rig(camera)), encoding="utf-8")
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    q = np.stack([9.0 * x + 5, 8.0 * y + 3], -1).astype(np.float32)
    weight = np.full(q.shape[:2], 0.5, np.float32)
    save_map(folder / "map.exr", q, {"weight": weight})
    save_map(folder / "map.npz", q, {"weight": weight})


def _camera(suffix: str) -> Any:
    def make(folder: Path) -> None:
        import cv2

        _inputs(folder, f"camera.{suffix}")
        storage = cv2.FileStorage(str(folder / f"camera.{suffix}"), cv2.FILE_STORAGE_WRITE)
        storage.write("image_width", WIDTH)
        storage.write("image_height", HEIGHT)
        storage.write("camera_matrix", np.array([[30.0, 0, 11.0], [0, 31.0, 7.0], [0, 0, 1]]))
        storage.write("distortion_coefficients", np.array([[-0.1, 0.02, 0.0, 0.0, 0.0]]))
        storage.release()

    return make


CAMERAS = {
    "kalibr.yaml": "cam0:\n  camera_model: pinhole\n  intrinsics: [30.0, 31.0, 11.0, 7.0]\n"
    "  distortion_model: radtan\n  distortion_coeffs: [-0.1, 0.02, 0.0, 0.0]\n"
    "  resolution: [24, 14]\n",
    "ros.yaml": "image_width: 24\nimage_height: 14\ncamera_name: a\ncamera_matrix:\n  rows: 3\n"
    "  cols: 3\n  data: [30.0, 0, 11.0, 0, 31.0, 7.0, 0, 0, 1]\ndistortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.1, 0.02, 0, 0, 0]\n",
    "colmap.txt": "# Camera list\n1 OPENCV 24 14 30.0 31.0 11.5 7.5 -0.1 0.02 0 0\n",
}
"""Camera files of other programs."""


def _cameras(folder: Path) -> None:
    for name, text in CAMERAS.items():
        inside = folder / name.partition(".")[0]
        inside.mkdir()
        _inputs(inside, name)
        (inside / name).write_text(text, encoding="utf-8")


def _result(folder: Path) -> None:
    """Write what a calibration leaves, with a truth that is the result itself."""
    from mitsuba_endo import backend
    from mitsuba_endo.records.solution import Outcome, load_solution, save_solution
    from mitsuba_endo.show.solution_folder import write_solution_folder

    from .made_up import made_up

    backend.use("llvm_ad_rgb")
    write_solution_folder(folder / "made", made_up())
    for path in (folder / "made").iterdir():
        path.rename(folder / path.name)
    (folder / "made").rmdir()
    truth = load_solution(folder / "solution.json")
    truth = truth.model_copy(update={"outcome": Outcome.TRUTH, "scale": "truth"})
    save_solution(folder / "truth.json", truth)


def _images(folder: Path) -> None:
    import cv2

    image = np.random.default_rng(1).integers(0, 255, (40, 60, 3)).astype(np.uint8)
    for name in ("a.png", "a.jpg", "a.tif", "a.bmp", "a.ppm"):
        cv2.imwrite(str(folder / name), image)
    cv2.imwrite(str(folder / "gray.png"), image[..., 0].astype(np.uint16) * 200)
    fourcc = cv2.VideoWriter.fourcc(*"MJPG")
    video = cv2.VideoWriter(str(folder / "a.avi"), fourcc, 10, (60, 40))
    for shift in range(4):
        video.write(np.roll(image, shift, 0))
    video.release()


def _meshes(folder: Path) -> None:
    import trimesh

    mesh = trimesh.creation.icosphere(2, 10.0)
    mesh.apply_translation([0, 0, 50])
    for name in ("a.ply", "a.stl", "a.obj", "a.off", "a.glb"):
        mesh.export(folder / name)
    text: Any = mesh.export(file_type="ply", encoding="ascii")
    (folder / "ascii.ply").write_bytes(text)


def _network(folder: Path) -> None:
    from importlib.resources import files

    weights = files("mitsuba_endo.decoding") / "weights" / "decoder.onnx"
    (folder / "decoder.onnx").write_bytes(weights.read_bytes())


def _scene(folder: Path) -> None:
    made = sound("result")
    for name in ("scene.xml", "surface.ply"):
        (folder / name).write_bytes((made / name).read_bytes())


def _dataset(form: str) -> Any:
    def make(folder: Path) -> None:
        import yaml

        from mitsuba_endo.dataset.config import load_config
        from mitsuba_endo.dataset.local_pool import LocalPool
        from mitsuba_endo.dataset.run import make_dataset

        (folder.parent / "config.yaml").write_text(yaml.safe_dump(_small(form)), encoding="utf-8")
        config = load_config(folder.parent / "config.yaml")
        progress = make_dataset(config, folder, 2, lambda job: LocalPool(job, 1))
        if progress.done != 2:  # a program without a guard before its main part has no workers
            raise RuntimeError("no sample was made")
        (folder.parent / "config.yaml").rename(folder / "config.yaml")

    return make


def _small(form: str) -> dict[str, Any]:
    sheet = {"distance": [40, 60], "width": 110, "height": 100, "edge": 8, "radius": 120}
    return {
        "seed": 3, "shard": 2, "format": form,
        "scenes": [{"kind": "bumpy_sheet", "parameters": sheet}],
        "camera": {"width": 40, "height": 30, "fov": [50, 60]},
        "pattern": {"variants": 1, "columns": 12, "rows": 10, "width": 160, "height": 130,
                    "oversample": 1},
        "projector": {"focal": [130, 150]},
        "capture": {
            "spp": 1, "max_depth": 2, "light": {},
            "tissue": {"subsurface": "none", "vessel_contrast": 0, "relief": 0},
        },
    }  # fmt: skip


MAKERS = {
    **FOREIGN,
    **SEQUENCE,
    "inputs": _inputs,
    "camera yaml": _camera("yaml"),
    "camera xml": _camera("xml"),
    "camera json": _camera("json"),
    "cameras": _cameras,
    "result": _result,
    "images": _images,
    "meshes": _meshes,
    "network": _network,
    "scene": _scene,
    "dataset files": _dataset("files"),
    "dataset hdf5": _dataset("hdf5"),
}

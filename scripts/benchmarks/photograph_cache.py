"""Photographs kept on disk: path tracing is by far the dearest part of benchmarks of images."""

import hashlib
from pathlib import Path

import numpy as np

from mitsuba_endo.files import atomic_path
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform

from . import decoder_scenes
from .decoder_scenes import Kind, Shot, shoot

FOLDER = Path("build/photographs")
"""Ignored by git. A change of decoder_scenes.py makes new ones; after one of the renderer
remove the folder."""


def cached_shot(kind: Kind, seed: int, *, spp: int, size: tuple[int, int]) -> Shot:
    """Return the photograph of :func:`.decoder_scenes.shoot`, traced once and then read."""
    recipe = hashlib.sha256(Path(decoder_scenes.__file__).read_bytes()).hexdigest()[:8]
    path = FOLDER / f"{kind}_{seed}_{size[0]}x{size[1]}_{spp}_{recipe}.npz"
    if not path.is_file():
        _save(path, shoot(kind, seed, spp=spp, size=size))
    return _load(path)


def _save(path: Path, shot: Shot) -> None:
    lens = shot.camera
    with atomic_path(path) as aside, aside.open("wb") as file:
        np.savez_compressed(
            file, laser=shot.laser, glints=shot.glints, q=shot.q, K=lens.K,
            size=np.array([lens.width, lens.height]), distortion=np.array(lens.distortion),
            world=shot.world_from_camera.matrix(), projector=shot.projector_from_camera.matrix(),
        )  # fmt: skip


def _load(path: Path) -> Shot:
    with np.load(path) as data:
        world, projector = (
            RigidTransform(data[name][:3, :3], data[name][:3, 3]) for name in ("world", "projector")
        )
        width, height = data["size"].tolist()
        lens = CameraModel("opencv", width, height, data["K"], tuple(data["distortion"].tolist()))
        return Shot(lens, world, projector, data["laser"], data["glints"], data["q"])

"""Where an optimisation stood after its iterations, coarsely: for pictures of how it went."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..geometry.transforms import RigidTransform
from ..reading.npz import Arrays, open_npz
from ..reading.regular import is_file
from .calibration import Snapshot

FILE = "history.npz"
KEPT = 40
"""Iterations that a file holds: Gauss-Newton takes fewer, Adam many more."""

Observe = Callable[[Snapshot], None]
"""Called after every iteration; an optimisation is slowed by as long as it takes."""


def scaled(history: Sequence[Snapshot], factor: float) -> list[Snapshot]:
    """Return a history with its lengths multiplied."""
    return [
        replace(
            s,
            surfaces=[factor * v for v in s.surfaces],
            world_from_camera=[RigidTransform(p.R, factor * p.t) for p in s.world_from_camera],
            projector_from_camera=[
                RigidTransform(p.R, factor * p.t) for p in s.projector_from_camera
            ],
        )
        for s in history
    ]


def thinned(history: Sequence[Snapshot], kept: int = KEPT) -> list[Snapshot]:
    """Return at most ``kept`` snapshots, evenly spread, first and last among them."""
    if len(history) <= kept:
        return list(history)
    return [
        history[i] for i in np.unique(np.linspace(0, len(history) - 1, kept).round().astype(int))
    ]


def save_history(path: str | Path, history: Sequence[Snapshot]) -> None:
    """Write snapshots as npz; vertices in half precision, 0.05 % of their distance.

    Raises:
        InputError: the file cannot be written.
    """
    arrays: dict[str, Any] = {
        "iteration": np.array([s.iteration for s in history]),
        "cost": np.array([np.nan if s.cost is None else s.cost for s in history]),
        "scale_px": np.array([np.nan if s.scale_px is None else s.scale_px for s in history]),
        "focal": np.array([s.focal for s in history]),
        "world_from_camera": _matrices([s.world_from_camera for s in history]),
        "projector_from_camera": _matrices([s.projector_from_camera for s in history]),
    }
    meshes: list[list[NDArray[np.int64]]] = []
    which = []
    for i, snapshot in enumerate(history):
        same = [k for k, faces in enumerate(meshes) if faces is snapshot.faces]
        if not same:
            arrays |= {
                f"faces_{len(meshes)}_{s}": f.astype(np.uint16)
                for s, f in enumerate(snapshot.faces)
            }
            meshes.append(snapshot.faces)
        which.append(same[0] if same else len(meshes) - 1)
        arrays |= {
            f"vertices_{i}_{s}": v.astype(np.float16) for s, v in enumerate(snapshot.surfaces)
        }
    arrays["mesh"] = np.array(which)
    with atomic_path(path) as aside:
        np.savez_compressed(aside, **arrays)


def load_history(folder: str | Path) -> list[Snapshot]:
    """Read the history of a solution folder; empty where there is none, as in older folders.

    Raises:
        InputError: it is damaged.
    """
    path = Path(folder) / FILE
    if not is_file(path):
        return []
    with open_npz(path, "history", "delete it") as data:
        return _snapshots(data)


def _snapshots(data: Arrays) -> list[Snapshot]:
    mesh = data.get("mesh", (None,), "iu")
    count = len(mesh)
    surfaces = range(sum(name.startswith("vertices_0_") for name in data.names))
    frames = data.get("focal", (count, None)).shape[1]
    focal = data.get("focal")
    meshes = [
        [data.get(f"faces_{m}_{s}", (None, 3), "iu").astype(np.int64) for s in surfaces]
        for m in range(int(mesh.max(initial=-1)) + 1)
    ]
    numbers = {name: data.get(name, (count,)) for name in ("iteration", "cost", "scale_px")}
    poses = {
        name: data.get(name, (count, frames, 4, 4))
        for name in ("world_from_camera", "projector_from_camera")
    }
    snapshots = [
        Snapshot(
            iteration=int(numbers["iteration"][i]),
            cost=_or_none(numbers["cost"][i]),
            scale_px=_or_none(numbers["scale_px"][i]),
            focal=focal[i].tolist(),
            surfaces=[
                data.get(f"vertices_{i}_{s}", (None, 3)).astype(np.float64) for s in surfaces
            ],
            faces=meshes[int(m)],
            **{name: _poses(of_frames[i]) for name, of_frames in poses.items()},
        )
        for i, m in enumerate(mesh)
    ]
    for snapshot in snapshots:
        _check(snapshot, data.source)
    return snapshots


def _check(snapshot: Snapshot, source: str) -> None:
    for vertices, faces in zip(snapshot.surfaces, snapshot.faces, strict=True):
        if faces.size and not (faces.min() >= 0 and faces.max() < len(vertices)):
            raise InputError("has triangles without vertices", source, "delete it")
    poses = (*snapshot.world_from_camera, *snapshot.projector_from_camera)
    numbers = [snapshot.focal, *(p.R for p in poses), *(p.t for p in poses)]
    if not all(np.isfinite(n).all() for n in numbers) or not snapshot.surfaces:
        raise InputError("is not a readable history", source, "delete it")


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _matrices(poses: Sequence[Sequence[RigidTransform]]) -> NDArray[np.float64]:
    return np.array([[p.matrix() for p in of_snapshot] for of_snapshot in poses])


def _poses(matrices: NDArray[np.float64]) -> list[RigidTransform]:
    return [RigidTransform(m[:3, :3], m[:3, 3]) for m in matrices]

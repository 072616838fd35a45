"""The state of an optimisation on disk, from which it can go on."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import DAMAGED_NPZ, atomic_path
from ..geometry.transforms import RigidTransform

FILE = "state.npz"


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything of an optimisation that its input files do not hold; lengths in baselines."""

    law: str
    stage: int
    """Stage of the robust objective."""
    names: list[str]
    """Frames that are part of it."""
    used: list[NDArray[np.bool_]]
    """(H, W) correspondences of every frame that enter the objective."""
    cells: list[float]
    """Lattice spacing of every surface, radians."""
    lattices: list[NDArray[np.int64]]
    """(V, 2) lattice indices of every surface's vertices."""
    faces: list[NDArray[np.int64]]
    """(F, 3) triangles of every surface."""
    weights: list[float]
    """Of every surface's curvature prior."""
    disparities: list[float]
    """Focal length times baseline that scales every prior, pattern pixels."""
    rho: list[NDArray[np.float64]]
    """(V,) inverse ranges of every surface."""
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]
    intrinsics: list[NDArray[np.float64]]
    """(9,) of every frame."""


def save_checkpoint(path: str | Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint as npz."""
    frames, surfaces = len(checkpoint.names), len(checkpoint.rho)
    arrays = {
        "law": np.array(checkpoint.law),
        "stage": np.array(checkpoint.stage),
        "names": np.array(checkpoint.names),
        "cells": np.array(checkpoint.cells),
        "weights": np.array(checkpoint.weights),
        "disparities": np.array(checkpoint.disparities),
        "intrinsics": np.array(checkpoint.intrinsics),
        "world_from_camera": np.array([p.matrix() for p in checkpoint.world_from_camera]),
        "projector_from_camera": np.array([p.matrix() for p in checkpoint.projector_from_camera]),
        **{f"used_{k}": checkpoint.used[k] for k in range(frames)},
        **{f"lattice_{i}": checkpoint.lattices[i] for i in range(surfaces)},
        **{f"faces_{i}": checkpoint.faces[i] for i in range(surfaces)},
        **{f"rho_{i}": checkpoint.rho[i] for i in range(surfaces)},
    }
    with atomic_path(path) as aside:
        np.savez_compressed(aside, **arrays)


def load_checkpoint(folder: str | Path) -> Checkpoint:
    """Read the checkpoint of a solution folder.

    Raises:
        InputError: there is none, or it is damaged.
    """
    path = Path(folder) / FILE
    if not path.is_file():
        raise InputError("no such file", str(path), "name the folder of an earlier calibration")
    try:
        # NumPy itself leaves a damaged file open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            names = [str(n) for n in data["names"]]
            surfaces = range(len(data["cells"]))
            return Checkpoint(
                law=str(data["law"]),
                stage=int(data["stage"]),
                names=names,
                used=[data[f"used_{k}"] for k in range(len(names))],
                cells=data["cells"].tolist(),
                lattices=[data[f"lattice_{i}"] for i in surfaces],
                faces=[data[f"faces_{i}"] for i in surfaces],
                weights=data["weights"].tolist(),
                disparities=data["disparities"].tolist(),
                rho=[data[f"rho_{i}"] for i in surfaces],
                world_from_camera=_poses(data["world_from_camera"]),
                projector_from_camera=_poses(data["projector_from_camera"]),
                intrinsics=list(data["intrinsics"]),
            )
    except DAMAGED_NPZ:
        raise InputError("is not a readable checkpoint", str(path), "start anew") from None


def _poses(matrices: NDArray[np.float64]) -> list[RigidTransform]:
    return [RigidTransform(m[:3, :3], m[:3, 3]) for m in matrices]

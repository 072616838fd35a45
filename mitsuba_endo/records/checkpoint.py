"""The state of an optimisation on disk, from which it can go on."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_path
from ..reading.npz import Arrays, open_npz
from ..reading.regular import is_file
from .rig import Rig
from .sealed_arrays import SEAL, check_seal, seal_of

FILE = "state.npz"
FORMAT = 4
"""Of the file; version 0.1 wrote files without a number, 2 had no checksum, 3 no devices."""

_CAMERA = ("model", "width", "height", "K", "distortion")


@dataclass(frozen=True, eq=False)
class SurfaceRecord:
    """One surface of an optimisation."""

    kind: str
    """Name of the class that reads ``arrays``."""
    arrays: Mapping[str, NDArray]
    """What the surface is made of, besides its values."""
    values: NDArray[np.float64]
    """(V,) one value a vertex."""
    weight: float
    """Of its smoothness."""
    disparity: float
    """Focal length times baseline that scales its smoothness, pattern pixels."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything of an optimisation that its input files do not hold; lengths in baselines."""

    law: str
    devices: str
    """The rig's camera and pattern, from which surfaces and correspondences were chosen; see
    :func:`devices_of`."""
    last_stage: bool
    """Whether the robust loss was in its last stage."""
    names: list[str]
    """Frames that are part of it."""
    used: list[NDArray[np.bool_]]
    """(H, W) correspondences of every frame that enter the cost."""
    surfaces: list[SurfaceRecord]
    values: Mapping[str, list[NDArray[np.float64]]]
    """Of every block of unknowns one array for each owner: a pose as (4, 4), others as (n,)."""


def devices_of(rig: Rig) -> str:
    """Return a rig's camera and size of the pattern as JSON, to be compared."""
    camera = rig.camera.model_dump(mode="json", include=set(_CAMERA))
    pattern = {"width": rig.projector.width, "height": rig.projector.height}
    return json.dumps({"camera": camera, "projector": pattern})


def save_checkpoint(path: str | Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint as npz."""
    arrays = {
        "format": np.array(FORMAT),
        "law": np.array(checkpoint.law),
        "devices": np.array(checkpoint.devices),
        "last_stage": np.array(checkpoint.last_stage),
        "names": np.array(checkpoint.names),
        "blocks": np.array(list(checkpoint.values)),
        "kinds": np.array([s.kind for s in checkpoint.surfaces]),
        "weights": np.array([s.weight for s in checkpoint.surfaces]),
        "disparities": np.array([s.disparity for s in checkpoint.surfaces]),
        **{f"used_{k}": used for k, used in enumerate(checkpoint.used)},
        **{f"block_{name}": np.array(values) for name, values in checkpoint.values.items()},
        **{f"values_{i}": s.values for i, s in enumerate(checkpoint.surfaces)},
        **{
            f"surface_{i}_{key}": array
            for i, s in enumerate(checkpoint.surfaces)
            for key, array in s.arrays.items()
        },
    }
    sealed: dict[str, Any] = arrays | {SEAL: seal_of(arrays.items())}
    with atomic_path(path) as aside:
        np.savez_compressed(aside, **sealed)


def load_checkpoint(folder: str | Path) -> Checkpoint:
    """Read the checkpoint of a solution folder.

    Raises:
        InputError: there is none, it is damaged, or another version wrote it.
    """
    path = Path(folder) / FILE
    if not is_file(path):
        raise InputError("no such file", str(path), "name the folder of an earlier calibration")
    with open_npz(path, "checkpoint", "start anew") as data:
        if "format" not in data or int(data.get("format", (), "iu")) != FORMAT:
            raise InputError(
                "was written by another version of this program", str(path),
                "calibrate anew without --resume",
            )  # fmt: skip
        check_seal(data, "calibrate anew without --resume")
        return _read(data)


def _read(data: Arrays) -> Checkpoint:
    names = [str(n) for n in data.get("names", (None,), "U")]
    surfaces = range(len(data.get("kinds", (None,), "U")))
    blocks = [str(name) for name in data.get("blocks", (None,), "U")]
    return Checkpoint(
        law=str(data.get("law", (), "U")),
        devices=str(data.get("devices", (), "U")),
        last_stage=bool(data.get("last_stage", (), "b")),
        names=names,
        used=[data.get(f"used_{k}", (None, None), "b") for k in range(len(names))],
        surfaces=[_surface(data, i) for i in surfaces],
        values={name: list(data.get(f"block_{name}")) for name in blocks},
    )


def _surface(data: Arrays, i: int) -> SurfaceRecord:
    prefix = f"surface_{i}_"
    named = [name for name in data.names if name.startswith(prefix)]
    return SurfaceRecord(
        kind=str(data.get("kinds", (None,), "U")[i]),
        arrays={name.removeprefix(prefix): data.get(name, kinds="fiub") for name in named},
        values=data.get(f"values_{i}", (None,)),
        weight=float(data.get("weights", (None,))[i]),
        disparity=float(data.get("disparities", (None,))[i]),
    )

"""Small input files for the tests of the commands."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from typer.testing import CliRunner

from mitsuba_endo.cli.main import app

WIDTH, HEIGHT = 24, 14
PROGRESS = re.compile(r"^\[ *[0-9.]+ s\] .*\n", re.M)
"""A line of a command's progress, as it stands in a log."""


@dataclass(frozen=True)
class Result:
    """How a command ended."""

    exit_code: int
    stdout: str
    stderr: str


def run(*arguments: object) -> Result:
    """Run ``mitsuba-endo`` in this process; lines of progress, which a slow machine adds, are left
    out of stderr."""
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    return Result(result.exit_code, result.stdout, PROGRESS.sub("", result.stderr))


def rig() -> dict[str, Any]:
    """Return the contents of a valid rig file, to be changed by the test."""
    return {
        "units": "mm",
        "camera": {
            "model": "opencv",
            "width": WIDTH,
            "height": HEIGHT,
            "K": [[30.0, 0, 11.0], [0, 31.0, 7.0], [0, 0, 1]],
            "distortion": [-0.1, 0.02],
        },
        "projector": {"law": "pinhole", "width": 240, "height": 120},
        "scale": {"baseline": 6.2},
    }


def q() -> np.ndarray:
    """Return a plausible (HEIGHT, WIDTH, 2) map, to be changed by the test."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([9.0 * x + 5, 8.0 * y + 3], -1).astype(np.float32)


def write(folder: Path, rig_data: Any = None, map_data: np.ndarray | None = None) -> None:
    """Write ``rig.yaml`` and ``map.npz``."""
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig_data or rig()), encoding="utf-8")
    np.savez(folder / "map.npz", map=q() if map_data is None else map_data)

"""The same four frames of one sheet on a triangle mesh and on the lattice, in turn."""

from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .frames import Frames, make_frames, sheet_distances
from .joint import errors
from .report import Figure

NAME = "mesh"
_figure = partial(Figure, NAME)


@dataclass(frozen=True)
class Sheet:
    """What one solve found of the sheet."""

    focal: float
    """Error, %."""
    shape: float
    """RMSE, mm."""
    vertices: int
    cpu: float
    """Processor time, seconds."""


def run(quick: bool) -> list[Figure]:
    """Calibrate seed after seed on either; ratios are of the medians."""
    pixels, seeds = (120, 2) if quick else (240, 4)
    warm = make_frames(4, 99, pixels=pixels)
    meshes, lattices = [], []
    solve(warm, "mesh")
    for seed in range(seeds):
        frames = make_frames(4, seed, pixels=pixels)
        meshes.append(solve(frames, "mesh"))
        lattices.append(solve(frames, "lattice"))
    shape, cpu, vertices = (
        [float(np.median([getattr(s, name) for s in found])) for found in (meshes, lattices)]
        for name in ("shape", "cpu", "vertices")
    )
    return [
        _figure("seeds", seeds, "", ""),
        _figure("focal error, worst", max(m.focal for m in meshes), "%", "lower", 0.1),
        _figure("shape RMSE, worst", max(m.shape for m in meshes), "mm", "lower", 0.12),
        _figure("shape RMSE / the lattice's", shape[0] / shape[1], "ratio", "lower", 1.1),
        _figure("processor time / the lattice's", cpu[0] / cpu[1], "ratio", "lower", 2),
        _figure("processor time, median", cpu[0], "s", "lower"),
        _figure("vertices, median", vertices[0], "", ""),
        _figure("vertices of the lattice, median", vertices[1], "", ""),
    ]


def solve(frames: Frames, surface: str) -> Sheet:
    """Solve frames on a kind of surface, and compare with the truth."""
    began = process_time()
    found = calibrate(frames.maps, frames.rig, Options(surface=surface))  # type: ignore[arg-type]
    cpu = process_time() - began
    vertices = found.surface.vertices
    shape = float(np.sqrt(np.mean(sheet_distances(vertices) ** 2)))
    return Sheet(errors(frames, found)[0], shape, len(vertices), cpu)

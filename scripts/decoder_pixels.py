"""Measure the decoder network per pixel, before graph and vote, on path-traced photographs.

python -m scripts.decoder_pixels --seeds 2

The scenes are the decoder benchmark's: surfaces, textures, code and seeds never trained on.
"""

from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.decode.grid.network import load_network
from mitsuba_endo.learn.compose import NEAR_NODE, Truth
from mitsuba_endo.learn.metrics import PixelMetrics, pixel_metrics
from mitsuba_endo.learn.views import JUMP, MIXED
from scripts.benchmarks.decoder_scenes import KINDS, PATTERN, Shot, shoot

Option = typer.Option


def truth_of(shot: Shot, visible: NDArray[np.bool_]) -> Truth:
    """Return what the network should say of a shot, with the benchmark's idea of lit."""
    known = PATTERN.truth(shot.q)
    step = np.zeros(shot.q.shape[:2])
    for axis, later in ((0, np.s_[1:]), (1, np.s_[:, 1:])):
        change = np.abs(np.diff(shot.q, axis=axis)).max(-1) / PATTERN.period
        step[later] = np.fmax(step[later], change)
    lit = np.isfinite(known.lattice[..., 0]) & visible & (step < MIXED)
    near = lit & (np.abs(known.lattice - known.node) < NEAR_NODE).all(-1)
    lattice = np.where(lit[..., None], known.lattice, 0).astype(np.float32)
    code = np.where(near, 1 - known.code, -1).astype(np.int8)
    return Truth(lattice.transpose(2, 0, 1), lit, code, step > JUMP)


def main(
    seeds: Annotated[int, Option(help="Photographs of each kind of scene.")] = 2,
    spp: Annotated[int, Option(help="Samples per pixel.")] = 32,
    weights: Annotated[str | None, Option(help="ONNX file; default the package's own.")] = None,
) -> None:
    """Photograph, run the network, print a table."""
    backend.use()
    network = load_network(weights)
    print("| scene | " + " | ".join(PixelMetrics.names()) + " |")
    for kind in KINDS:
        shots = [(seed, shoot(kind, seed, spp=spp)) for seed in range(1, seeds + 1)]
        for heavy in (False, True):
            images = [(shot, *shot.image(heavy, seed)) for seed, shot in shots]
            heads = [network.heads(image) for _, image, _ in images]
            found = pixel_metrics(heads, [truth_of(shot, lit) for shot, _, lit in images])
            values = " | ".join(f"{getattr(found, name):.4f}" for name in PixelMetrics.names())
            print(f"| {kind}, {'heavy' if heavy else 'clean'} | {values} |", flush=True)


if __name__ == "__main__":
    typer.run(main)

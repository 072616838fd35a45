"""Measure the decoder network per pixel, before graph and vote, on path-traced photographs.

python -m scripts.decoder_pixels --seeds 2

The scenes are the decoder benchmark's: surfaces, textures, code and seeds never trained on.
"""

from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.dataset.truth import MIXED, largest_step
from mitsuba_endo.decoding.network import load_network
from mitsuba_endo.learn.compose import NEAR_NODE, Targets
from mitsuba_endo.learn.pixel_metrics import pixel_metrics
from scripts.benchmarks.decoder_scenes import KINDS, PATTERN, Shot, shoot

Option = typer.Option
SHOWN = ("median", "p95", "gross", "coverage", "code_right", "false_share")


def truth_of(shot: Shot, visible: NDArray[np.bool_]) -> Targets:
    """Return what the network should have said of a shot, with the benchmark's idea of lit.

    Depth edges in shadow are unknown here: edges are left out.
    """
    known = PATTERN.truth(shot.q)
    mixed = largest_step(shot.q / PATTERN.period) > MIXED
    lit = np.isfinite(known.lattice[..., 0]) & visible & ~mixed
    near = lit & (np.abs(known.lattice - known.node) < NEAR_NODE).all(-1)
    lattice = np.where(lit[..., None], known.lattice, 0).astype(np.float32)
    code = np.where(near, 1 - known.code, -1).astype(np.int8)
    return Targets(lattice.transpose(2, 0, 1), lit, code, np.zeros_like(lit))


def main(
    seeds: Annotated[int, Option(help="Photographs of each kind of scene.")] = 2,
    spp: Annotated[int, Option(help="Samples per pixel.")] = 32,
    weights: Annotated[str | None, Option(help="ONNX file; default the package's own.")] = None,
) -> None:
    """Photograph, run the network, print a table."""
    backend.use()
    network = load_network(weights)
    print("| scene | " + " | ".join(SHOWN) + " |")
    for kind in KINDS:
        shots = [(seed, shoot(kind, seed, spp=spp)) for seed in range(1, seeds + 1)]
        for heavy in (False, True):
            images = [(shot, *shot.image(heavy, seed)) for seed, shot in shots]
            heads = [network.heads(image) for _, image, _ in images]
            found = pixel_metrics(heads, [truth_of(shot, lit) for shot, _, lit in images])
            values = " | ".join(f"{getattr(found, name):.4f}" for name in SHOWN)
            print(f"| {kind}, {'heavy' if heavy else 'clean'} | {values} |", flush=True)


if __name__ == "__main__":
    typer.run(main)

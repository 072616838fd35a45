"""The picture of docs/refinement.md: errors of coordinates before and after the refinement.

python -m scripts.make_refinement_picture [--out docs/images/refinement.png]
"""

from pathlib import Path
from typing import Annotated

import matplotlib
import numpy as np
import typer

from mitsuba_endo import backend
from mitsuba_endo.decoding.network import load_network
from scripts.benchmarks.decoder_scenes import PATTERN, Kind
from scripts.benchmarks.image import judge, photograph_of
from scripts.benchmarks.photograph_cache import cached_shot

SHOTS: tuple[tuple[Kind, int, str], ...] = (
    ("sheet", 801, "clean"), ("stomach", 801, "clean"), ("colon", 801, "moderate"),
)  # fmt: skip
RANGE = 0.03
"""Periods at the ends of the colours."""


def main(
    out: Annotated[Path, typer.Option(help="Picture to write.")] = Path(
        "docs/images/refinement.png"
    ),
) -> None:
    """Draw three scenes of the benchmark ``image``."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    backend.use()
    network = load_network()
    figure, axes = plt.subplots(3, 5, figsize=(15, 7.2), layout="constrained")
    shown = None
    for row, (kind, seed, condition) in zip(axes, SHOTS, strict=True):
        shot = cached_shot(kind, seed, spp=16, size=(480, 360))
        case = judge(network, kind, seed, condition, shot)
        row[0].imshow(photograph_of(shot, condition, seed)[0])
        row[0].set_ylabel(f"{kind}, {condition}")
        for k, axis in enumerate("xy"):
            for i, (name, map_) in enumerate(
                (("decoded", case.decoded), ("refined", case.refined.map))
            ):
                error = (map_.q - shot.q)[..., k] / PATTERN.period
                shown = row[1 + 2 * k + i].imshow(error, "RdBu", vmin=-RANGE, vmax=RANGE)
                rms = float(np.sqrt(np.nanmean(error[np.abs(error) < 10 * RANGE] ** 2)))
                row[1 + 2 * k + i].set_title(f"{axis}, {name}: RMS {rms:.4f}", fontsize=10)
        for ax in row:
            ax.set(xticks=[], yticks=[])
    assert shown is not None
    figure.colorbar(shown, ax=axes[:, 4], label="error, grid periods", shrink=0.6)
    figure.savefig(out, dpi=80)


if __name__ == "__main__":
    typer.run(main)

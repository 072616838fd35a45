"""Ask whether a graph network would judge the decoder's links better than its rules do.

python -m scripts.compare_graph_network --out build/decoder

Trains a small graph network on what the pixel network says of the training views, a minute or two
on one core, and draws wrong periods over coverage for both. The decoder has no such network, since
it did not beat the rules (see the model card); ask again when the pixel network or the rules have
changed. Needs the extra `learn`. The views are those of scripts.train_decoder, made if missing.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import cv2
import torch  # pyright: ignore[reportMissingImports]
import typer

from mitsuba_endo import backend
from mitsuba_endo.decode.grid.network import Network, load_network
from mitsuba_endo.learn.cache import CacheSettings, open_cache
from mitsuba_endo.learn.graph_curves import METHODS, Case, curves, save_comparison
from mitsuba_endo.learn.graph_loop import GraphPlan, graphs_of, train_graph_net
from mitsuba_endo.learn.patterns import grid_texture
from mitsuba_endo.learn.validation import UNSEEN, validation_images
from scripts.benchmarks.decoder_scenes import PATTERN, Kind, shoot
from scripts.decoder_pixels import truth_of

Option = typer.Option
TRACED: tuple[Kind, ...] = ("colon", "rabbit")
"""Of the benchmark's scenes, those with folds and outlines."""


def main(
    out: Annotated[Path, Option(help="Folder of the views; gets graph_network.png.")] = Path(
        "build/decoder"
    ),
    weights: Annotated[Path | None, Option(help="ONNX file; default the package's own.")] = None,
    views: Annotated[int, Option(help="Training views.")] = 480,
    validation: Annotated[int, Option(help="Validation views.")] = 40,
    traced: Annotated[int, Option(help="Path-traced scenes of each kind, too.")] = 0,
    graphs: Annotated[int, Option(help="Graphs to train on.")] = GraphPlan.graphs,
    seed: int = 0,
) -> None:
    """Make graphs, train, compare, draw, print a table."""
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
    network, plan = load_network(weights), GraphPlan(graphs=graphs, seed=seed)
    seen = open_cache(out / "views", CacheSettings(views=views, seed=seed))

    def tick(done: int) -> None:
        if done % 100 == 0:
            typer.echo(f"{done} graphs")

    net = train_graph_net(graphs_of(seen, network, plan, tick), plan)
    unseen = CacheSettings(views=validation, per_surface=2, seed=9000 + seed)
    cases = [*_validation(out / "validation", unseen, network), *_traced(traced, network)]
    found = curves(cases, net)
    save_comparison(out / "graph_network.png", found)
    typer.echo("| images | coverage | wrong periods: " + " | ".join(METHODS) + " |")
    for scenario, methods in found.items():
        both = min(curve.coverage[0] for curve in methods.values())
        values = [f"{100 * both:.1f} %", *(f"{100 * c.at(both):.2f} %" for c in methods.values())]
        typer.echo(f"| {scenario} | {' | '.join(values)} |")


def _validation(folder: Path, settings: CacheSettings, network: Network) -> Iterator[Case]:
    for index, image in enumerate(validation_images(open_cache(folder, settings))):
        # Two images of each view, both under the view's own grid.
        code = grid_texture(UNSEEN + index // 2).code
        yield Case(image.scenario, network.heads_of_input(image.image), image.truth, code)


def _traced(seeds: int, network: Network) -> Iterator[Case]:
    if seeds:
        backend.use()
    for kind in TRACED:
        for seed in range(1, seeds + 1):
            shot = shoot(kind, seed)
            for heavy in (False, True):
                image, lit = shot.image(heavy, seed)
                name = f"traced {kind}, {'heavy' if heavy else 'clean'}"
                yield Case(name, network.heads(image), truth_of(shot, lit), PATTERN.code)


if __name__ == "__main__":
    typer.run(main)

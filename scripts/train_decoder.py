"""Train the decoder network from nothing: make the views, train, validate, export.

python -m scripts.train_decoder --out build/decoder --minutes 50

Run again with the same --out it goes on where it stopped. Needs the extra `learn`.
"""

import os
import shutil
from pathlib import Path
from typing import Annotated

import cv2
import torch  # pyright: ignore[reportMissingImports]
import typer

from mitsuba_endo.learn.cache import CacheSettings, open_cache
from mitsuba_endo.learn.loop import TrainingPlan, train
from mitsuba_endo.learn.validation import validation_images

Option = typer.Option
SHIPPED = Path(__file__).parents[1] / "mitsuba_endo/decoding/weights/decoder.onnx"


def main(
    out: Annotated[Path, Option(help="Folder of views, checkpoint, curves and network.")] = Path(
        "build/decoder"
    ),
    minutes: Annotated[float | None, Option(help="Minutes of training, all runs together.")] = None,
    steps: Annotated[int | None, Option(help="Steps instead: repeats to the bit.")] = None,
    views: Annotated[int, Option(help="Training views to cast.")] = 480,
    validation: Annotated[int, Option(help="Validation views to cast.")] = 40,
    batch: int = 8,
    rate: Annotated[float, Option(help="Highest learning rate.")] = 2e-3,
    epoch: Annotated[int, Option(help="Steps between validations.")] = 100,
    seed: int = 0,
    threads: Annotated[int, Option(help="Of PyTorch on the CPU.")] = os.cpu_count() or 1,
    workers: Annotated[int, Option(help="Processes that make examples.")] = 1,
    ship: Annotated[bool, Option(help="Copy the network into the package.")] = False,
) -> None:
    """Parse, call, save."""
    torch.set_num_threads(threads)
    # OpenCV's own threads do not survive the fork of the processes that make examples.
    cv2.setNumThreads(0)
    plan = TrainingPlan(minutes=minutes, steps=steps, batch=batch, rate=rate, epoch=epoch,
                        seed=seed, workers=workers)  # fmt: skip

    def tick(done: int) -> None:
        if done % 20 == 0:
            typer.echo(f"{done} views")

    unseen = CacheSettings(views=validation, per_surface=2, seed=9000 + seed)
    held_out = validation_images(open_cache(out / "validation", unseen, tick))
    seen = open_cache(out / "views", CacheSettings(views=views, seed=seed), tick)
    network = train(plan, seen, held_out, out, typer.echo)
    if ship:
        for suffix in (".onnx", ".json"):
            shutil.copyfile(network.with_suffix(suffix), SHIPPED.with_suffix(suffix))


if __name__ == "__main__":
    typer.run(main)

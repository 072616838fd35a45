"""Kill a dataset again and again, and compare it with one that was not interrupted.

python -m scripts.reliability_dataset --count 500 --kills 20 --seed 1 --out dataset-kills
"""

import os
import signal
import sys
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from scripts.reliability.commands import DATASET, dataset_command, run, start
from scripts.reliability.sound import VARIABLE
from scripts.reliability_kills import contents, leftovers

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
Option = typer.Option


def main(
    count: Annotated[int, Option(min=1, help="Samples.")] = 500,
    kills: Annotated[int, Option(min=1, help="Kills of the live process.")] = 20,
    seed: Annotated[int, Option(min=0)] = 0,
    form: Annotated[str, Option("--format", help="files or hdf5.")] = "files",
    out: Annotated[Path, Option(help="Folder to work in; it must be new.")] = Path("dataset-kills"),
) -> None:
    """Parse, kill, compare, tell."""
    os.environ[VARIABLE] = str((out / "sound").absolute())
    command, rng = dataset_command(count, form), np.random.default_rng(seed)
    whole, killed = (out.absolute() / name for name in ("whole", "killed"))
    for folder in (whole, killed):
        folder.mkdir(parents=True)
        command.prepare(folder)
    started = time.monotonic()
    run(whole, *command.arguments)
    seconds = time.monotonic() - started
    hits = 0
    while hits < kills:
        process = start(killed, command.arguments)
        # Short enough that samples are left to the last run.
        time.sleep(rng.uniform(1.0, max(2.0, 0.9 * seconds / kills)))
        if process.poll() is None:
            hits += 1
            process.send_signal(SIGNALS[int(rng.integers(len(SIGNALS)))])
        process.communicate()
    there = len(list((killed / DATASET / "samples").glob("[0-9]*")))
    run(killed, *command.arguments)
    first, second = (contents(folder / DATASET) for folder in (whole, killed))
    other = sorted(k for k in {*first, *second} if first.get(k) != second.get(k))
    left = leftovers(killed)
    typer.echo(
        f"{count} samples, {len(first)} files; {hits} kills, {there} samples before the last run; "
        f"{len(other)} files differ, {len(left)} left over {other[:3]} {left[:3]}"
    )
    sys.exit(1 if other or left else 0)


if __name__ == "__main__":
    typer.run(main)

"""Benchmarks: pairs measured in one run, printed with unit and direction, and saved.

python scripts/benchmark.py --out benchmark-output [--only NAME]... [--add] [--quick]
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from benchmarks import (
    bundle_adjustment,
    capture,
    dataset,
    decoder,
    decoder_end_to_end,
    emitter_cost,
    first_order,
    full_resolution,
    image,
    joint,
    joint_mesh,
    model_error,
    pages,
    placement,
    random_rigs,
    real_captures,
    robustness,
    scaling,
    sequence,
    shared_rig,
    stacks,
    verdicts,
)
from benchmarks.report import Figure, renewed, save, saved, show
from rich.console import Console

from mitsuba_endo import backend

BENCHMARKS = {
    module.NAME: module
    for module in (
        bundle_adjustment,
        first_order,
        full_resolution,
        emitter_cost,
        real_captures,
        joint,
        joint_mesh,
        model_error,
        pages,
        placement,
        random_rigs,
        robustness,
        scaling,
        sequence,
        shared_rig,
        verdicts,
        dataset,
        capture,
        decoder,
        decoder_end_to_end,
        image,
        stacks,
    )
}


RUNS: dict[str, Callable[[bool], list[Figure]]] = {
    **{name: module.run for name, module in BENCHMARKS.items()},
    **{f"{sequence.NAME}/{part}": run for part, run in sequence.PARTS.items()},
}
"""Whole benchmarks, and parts of long ones."""


def main(
    out: Annotated[Path, typer.Option(help="Folder for benchmark.json and benchmark.csv.")] = Path(
        "benchmark-output"
    ),
    only: Annotated[
        list[str] | None, typer.Option(help=f"Run these alone: {', '.join(RUNS)}.")
    ] = None,
    add: Annotated[
        bool, typer.Option(help="Keep figures in the folder that are not measured anew.")
    ] = False,
    quick: Annotated[bool, typer.Option(help="Small inputs, to see that it runs.")] = False,
) -> None:
    """Run the benchmarks and report their figures."""
    unknown = set(only or ()) - set(RUNS)
    if unknown:
        raise typer.BadParameter(f"no benchmark {', '.join(sorted(unknown))}", param_hint="--only")
    backend.use()
    console = Console()
    figures: list[Figure] = []
    for name in only or BENCHMARKS:
        console.print(f"[bold]{name}[/]: {_about(name)}")
        figures += RUNS[name](quick)
    if not figures:
        console.print("Nothing was measured: the input of these benchmarks is absent.")
        return
    show(figures, console)
    save(renewed(saved(out), figures) if add else figures, out)


def _about(name: str) -> str:
    """Return the first line of what a benchmark says of itself."""
    told = BENCHMARKS[name].__doc__ if name in BENCHMARKS else RUNS[name].__doc__
    return (told or "").splitlines()[0]


if __name__ == "__main__":
    typer.run(main)

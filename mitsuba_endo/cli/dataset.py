"""``mitsuba-endo dataset``: many synthetic captures with their truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .console import EXIT_FAULT, Debug, Json, Quiet, Session, session

if TYPE_CHECKING:
    from ..dataset.config import Config
    from ..dataset.run import Progress

ConfigFile = Annotated[
    Path | None,
    typer.Argument(metavar="[CONFIG]", help="YAML file; without one, the built-in configuration."),
]
Out = Annotated[Path, typer.Option("--out", help="Folder to write, or to go on with.")]
Count = Annotated[int, typer.Option(min=1, help="Samples to make in all.")]
Format = Annotated[
    Literal["files", "hdf5"] | None,
    typer.Option("--format", help="Folder of files, or HDF5 shards; else as the configuration."),
]
Seed = Annotated[int | None, typer.Option(min=0, help="Instead of the configuration's seed.")]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Processes on this machine; default: one a core.")
]
Dask = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster to work on.")
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Try samples again that failed before.")
]
Example = Annotated[
    bool, typer.Option("--example", help="Print a configuration with comments, and end.")
]


def dataset(
    config: ConfigFile = None,
    out: Out = Path("dataset"),
    count: Count = 20,
    format_: Format = None,
    seed: Seed = None,
    workers: Workers = None,
    dask: Dask = None,
    retry_failed: RetryFailed = False,
    example: Example = False,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Make synthetic captures with truth: in parallel, repeatable, and resumed where they ended."""
    with session(quiet, as_json, debug) as output:
        from ..dataset.config import example_config

        if example:
            typer.echo(example_config(), nl=False)
            return
        resolved = _resolve(config, format_, seed, dask, workers)
        progress = _make(resolved, out, count, workers, dask, retry_failed, output)
        _report(out, progress, output)
        raise typer.Exit(0 if progress.done else EXIT_FAULT)


def _resolve(
    path: Path | None, format_: str | None, seed: int | None, dask: str | None, workers: int | None
) -> "Config":
    """Read the configuration and put the command's options into it."""
    from ..dataset.config import load_config
    from ..errors import InputError

    if dask and workers:
        raise InputError("--dask and --workers are both given", None, "keep one")
    config = load_config(path)
    options = {"format": format_, "seed": seed}
    return config.model_copy(update={k: v for k, v in options.items() if v is not None})


def _make(
    config: "Config", out: Path, count: int, workers: int | None, dask: str | None,
    retry_failed: bool, output: Session,
) -> "Progress":  # fmt: skip
    """Make the samples and their contact sheets with a progress bar."""
    from ..dataset.contact_sheet import write_contact_sheets
    from ..dataset.reader import Dataset
    from ..dataset.run import make_dataset
    from ..dataset.shard_store import hdf5

    if config.format == "hdf5":
        hdf5()
    with output.progress("Preparing") as advance:
        progress = make_dataset(
            config, out, count, _pool(workers, dask),
            lambda p: advance((p.done + p.failed) / p.count, describe(p)), retry_failed,
        )  # fmt: skip
        advance(1.0, "Drawing contact sheets")
        if progress.done:
            write_contact_sheets(Dataset(out))
    return progress


def _pool(workers: int | None, dask: str | None):
    from functools import partial

    if dask:
        from ..dataset.dask_pool import DaskPool

        return partial(DaskPool, address=dask)
    from ..dataset.local_pool import LocalPool, cores

    return partial(LocalPool, workers=workers or cores())


def describe(progress: "Progress") -> str:
    """Return how far it is, how fast, and how long it will take."""
    text = f"{progress.done + progress.failed} of {progress.count}"
    if progress.failed:
        text += f" ({progress.failed} failed)"
    if progress.seconds_left is None:
        return text
    return f"{text}, {60 * progress.rate:.1f} a minute, {_duration(progress.seconds_left)} left"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def _report(out: Path, progress: "Progress", output: Session) -> None:
    from ..dataset.run import failures

    failed = failures(out)
    output.print(f"{out}: {progress.done} samples, {len(failed)} failed.")
    for record in failed[:5]:
        output.print(f"  sample {record['index']} failed: {record['reason']}")
    if len(failed) > 5:
        output.print(f"  and {len(failed) - 5} more, see {out}/failed/")
    if progress.done:
        output.print(f"Look at {out}/contact_sheet_00.png first.")
    output.summary(
        {"folder": str(out), "done": progress.done, "failed": progress.failed,
         "count": progress.count}
    )  # fmt: skip

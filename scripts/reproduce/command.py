"""What every experiment's command line has."""

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

Out = Annotated[Path, typer.Option(help="Folder for tables, pictures and captures.")]
Quick = Annotated[bool, typer.Option(help="Small inputs, to see that it runs.")]
Workers = Annotated[int, typer.Option(help="Processes that solve at the same time.")]
OUT = Path("reproduce-output")


def need(*modules: str) -> None:
    """End with one sentence and code 2 if a peer is not installed."""
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        todo = 'pip install -e ".[reproduce]"'
        typer.echo(f"{' and '.join(missing)} not installed; {todo} or make reproduce", err=True)
        raise typer.Exit(2)

"""What every experiment's command line has."""

from pathlib import Path
from typing import Annotated

import typer

Out = Annotated[Path, typer.Option(help="Folder for tables, pictures and captures.")]
Quick = Annotated[bool, typer.Option(help="Small inputs, to see that it runs.")]
Workers = Annotated[int, typer.Option(help="Processes that solve at the same time.")]
OUT = Path("reproduce-output")

"""Arguments and options that several commands take alike."""

from pathlib import Path
from typing import Annotated

import typer

Result = Annotated[
    Path, typer.Argument(metavar="RESULT", help="Solution folder, or its solution.json.")
]
MaybeTruth = Annotated[
    Path | None,
    typer.Option(
        "--truth", metavar="FILE", help="Truth of a synthetic capture, if it lies elsewhere."
    ),
]
Port = Annotated[int, typer.Option(min=0, max=65535, help="First port to try.")]
Host = Annotated[
    str, typer.Option(help="Address to listen at; 0.0.0.0 for other machines, with a token.")
]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open a browser.")]

PORT, HOST = 8080, "localhost"


def names_in(text: str) -> list[str]:
    """Return the names in a list with commas."""
    return [part.strip() for part in text.split(",") if part.strip()]

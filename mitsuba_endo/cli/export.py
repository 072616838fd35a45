"""``mitsuba-endo export``: a solution in another program's format."""

from pathlib import Path
from typing import Annotated

import typer

from .console import Debug, Json, Quiet, session
from .options import Result

Format = Annotated[
    str,
    typer.Option("--format", metavar="NAME", help="opencv, ros, kalibr, colmap, ply or mitsuba."),
]
Out = Annotated[
    Path, typer.Option("--out", help="File to write; a folder for ros, colmap and mitsuba.")
]


def export(
    result: Result,
    format_: Format,
    out: Out,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write a solution for OpenCV, COLMAP, Mitsuba or as a PLY surface."""
    with session(quiet, as_json, debug) as output:
        from ..show.exports import EXPORTERS
        from ..show.exports import export as write

        write(result, format_, out)
        output.print(f"{out}: {EXPORTERS[format_].about}.")
        output.summary({"format": format_, "out": str(out)})

"""The command line: every subcommand."""

from typing import Annotated

import typer

from .. import __version__
from .calibrate import calibrate
from .dataset import dataset
from .decode import decode
from .decode_stack import decode_stack
from .demo import demo
from .doctor import doctor
from .evaluate import evaluate
from .export import export
from .patterns import patterns
from .refine import refine
from .render import render
from .report import report
from .sequence import sequence
from .usage import Commands
from .view import view

app = typer.Typer(
    name="mitsuba-endo",
    cls=Commands,
    help="Calibrate camera-projector pairs and 3D endoscopes without a target.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
COMMANDS = (
    demo,
    doctor,
    render,
    patterns,
    decode,
    decode_stack,
    refine,
    calibrate,
    sequence,
    evaluate,
    dataset,
    report,
    view,
    export,
)
for command in COMMANDS:
    app.command()(command)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback(
    epilog="Exit codes: 0 done, 1 not converged or a fault found, 2 bad input, "
    "3 no pattern found, 70 internal error, 71 no memory or threads left, 130 interrupted."
)
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    pass

"""What every command does alike: where output goes, what errors look like, exit codes.

Human output goes to stdout, and to stderr with ``--json``, whose stdout is one JSON object and
nothing else. Progress and errors go to stderr. ``--quiet`` leaves only errors and JSON.
"""

import contextlib
import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from ..interrupts import is_interrupt
from .entry import EXIT_INTERRUPTED, INTERRUPTED
from .faults import internal, sentence

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

EXIT_FAULT = 1
"""Done, but with a result to be wary of: not converged, or doctor found a fault."""
EXIT_INTERNAL = 70
"""An unexpected exception (EX_SOFTWARE of sysexits.h)."""

EVERY = 10.0
"""Seconds between lines of one step outside a terminal."""
SHORT = 2.0
"""Seconds of work that need no word."""

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON on stdout.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")]

Advance = Callable[[float, str], None]
"""Called with the share done, 0 to 1, and what is being done now."""


class Session:
    """Output of one run of a command."""

    def __init__(self, quiet: bool, as_json: bool) -> None:
        self.quiet, self.as_json = quiet, as_json

    def print(self, *lines: "RenderableType") -> None:
        """Print for a human reader."""
        if not self.quiet:
            _console(stderr=self.as_json).print(*lines, sep="\n")

    def summary(self, data: dict[str, Any]) -> None:
        """Print the machine-readable summary, if asked for."""
        if self.as_json:
            print(json.dumps(data, indent=1, allow_nan=False), file=sys.stdout, flush=True)

    @contextlib.contextmanager
    def progress(self, text: str) -> Iterator[Advance]:
        """Show what is being done on stderr and yield the function that tells it.

        In a terminal as a bar; elsewhere, in a file or another program's log, as a line for each
        step and frame, and of a long step one in :data:`EVERY` seconds; none of short work.
        """
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
        console = _console(stderr=True)
        if not self.quiet and not console.is_terminal:
            yield _Lines(text).advance
            return
        with Progress(*columns, console=console, transient=True, disable=self.quiet) as bar:
            task = bar.add_task(text, total=None)

            def advance(share: float, what: str) -> None:
                bar.update(task, completed=share, total=1.0, description=what)

            yield advance


class _Lines:
    """Progress as lines of a log."""

    def __init__(self, text: str) -> None:
        self._began = self._told = time.monotonic()
        self._said = ""
        self.advance(0.0, text)

    def advance(self, _share: float, what: str) -> None:
        """Print a step or frame when it begins, and then now and then; nothing of short work."""
        now, step = time.monotonic(), what.partition(" (")[0]
        if now - self._began < SHORT or (step == self._said and now - self._told < EVERY):
            return
        self._said, self._told = step, now
        print(f"[{now - self._began:6.1f} s] {what}", file=sys.stderr, flush=True)


@contextlib.contextmanager
def session(quiet: bool, as_json: bool, debug: bool) -> Iterator[Session]:
    """Run a command's body: turn what it raises into one sentence and an exit code."""
    try:
        with _stdout_for_json_only(as_json):
            yield Session(quiet, as_json)
    except typer.Exit:
        raise
    except (KeyboardInterrupt, Exception) as error:  # the boundary: nothing above handles it
        if is_interrupt(error):
            # Caught within exec of a text (libraries build classes so), an interrupt leaves a mark
            # with which CPython ends by the signal, whatever the exit code; the next exec wipes it
            # off.
            exec("")
            _fail(INTERRUPTED, EXIT_INTERRUPTED, as_json)
        told = sentence(error)
        if told is not None:
            _fail(*told, as_json)
        if debug:
            traceback.print_exc()
        _fail(internal(error, debug), EXIT_INTERNAL, as_json)


def _fail(message: str, code: int, as_json: bool) -> NoReturn:
    print(f"error: {message}", file=sys.stderr)
    if as_json:
        print(json.dumps({"error": message, "exit_code": code}))
    raise typer.Exit(code)


@contextlib.contextmanager
def _stdout_for_json_only(as_json: bool) -> Iterator[None]:
    """Send to stderr what libraries print: Mitsuba, in C++, logs to stdout.

    ``sys.stdout`` is pointed at a copy of the real stdout, so that Python's own prints (the
    summary) still reach it.
    """
    if not as_json or sys.stdout is not sys.__stdout__:
        yield  # plain output, or stdout is captured by a test and has no descriptor
        return
    sys.stdout.flush()
    real = os.dup(1)
    os.dup2(2, 1)
    try:
        with (
            open(real, "w", encoding="utf-8", closefd=False) as stdout,
            contextlib.redirect_stdout(stdout),
        ):
            yield
    finally:
        os.dup2(real, 1)
        os.close(real)


def _console(stderr: bool) -> "Console":
    from rich.console import Console

    # No markup: messages may hold square brackets.
    return Console(stderr=stderr, highlight=False, markup=False)

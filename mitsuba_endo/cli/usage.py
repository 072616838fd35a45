"""What a wrong command line is told: one sentence, as any other bad input."""

import sys
from typing import Any

import typer
from typer.core import TyperGroup

UsageError: type[Exception] = typer.BadParameter.__mro__[1]
"""Of Click, which some versions of Typer bring along under another name."""


class Commands(TyperGroup):
    """The commands; Typer would draw a box of five lines around what is wrong."""

    def main(self, *args: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        """Run the command line and end with its exit code."""
        try:
            code = super().main(*args, standalone_mode=False, **extra)
        except UsageError as error:
            if not standalone_mode:
                raise
            code = _told(error)
        if not standalone_mode:
            return code
        sys.exit(code or 0)


def _told(error: Any) -> int:
    """Print a usage error; return its exit code."""
    message = " ".join(error.format_message().split()).rstrip(".")
    command = error.ctx.command_path if error.ctx else "mitsuba-endo"
    if type(error).__name__ == "NoArgsIsHelpError":  # Typer with Rich has printed the help
        print(error.format_message(), end="")
    else:
        print(f"error: {message}; see {command} --help.", file=sys.stderr)
    return error.exit_code

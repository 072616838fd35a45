"""Which of many things a campaign's option ``--only`` means."""

from collections.abc import Mapping
from typing import TypeVar

import typer

Thing = TypeVar("Thing")


def chosen_by(beginning: str | None, things: Mapping[str, Thing]) -> list[Thing]:
    """Return the things whose names begin so; all without a beginning.

    Raises:
        typer.BadParameter: none does.
    """
    chosen = [t for name, t in things.items() if beginning is None or name.startswith(beginning)]
    if not chosen:
        message = f"nothing begins with {beginning!r}; there are {', '.join(sorted(things))}"
        raise typer.BadParameter(message, param_hint="--only")
    return chosen

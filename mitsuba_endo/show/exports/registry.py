"""Names of the exporters; adding one is a function with ``@register_exporter``."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ...records.solution import Solution, load_solution

Write = Callable[[Solution, Path, Path], None]
"""Called with the solution, the folder it lies in, and the path to write."""


@dataclass(frozen=True)
class Exporter:
    """A format to which a solution can be written."""

    name: str
    about: str
    """What is written, in a few words."""
    write: Write


EXPORTERS: dict[str, Exporter] = {}


def register_exporter(name: str, about: str) -> Callable[[Write], Write]:
    """Decorator that makes a function available as a format."""

    def register(write: Write) -> Write:
        EXPORTERS[name] = Exporter(name, about, write)
        return write

    return register


def export(result: str | Path, name: str, out: str | Path) -> None:
    """Write a solution in another program's format.

    Args:
        result: solution folder, or its solution.json.
        name: one of :data:`EXPORTERS`.
        out: file to write, or folder where the format consists of several files.

    Raises:
        InputError: unknown format, unreadable solution, a value that the format needs was not
            determined, or ``out`` cannot be written.
    """
    if name not in EXPORTERS:
        raise InputError(f"unknown format '{name}'", "--format", f"give {', '.join(EXPORTERS)}")
    result = Path(result)
    solution = load_solution(result)
    EXPORTERS[name].write(solution, result if result.is_dir() else result.parent, Path(out))

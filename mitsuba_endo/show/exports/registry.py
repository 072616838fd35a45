"""Names of the exporters; adding one is a function with ``@register_exporter``."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ...folder_mark import Kind
from ...outputs import prepare_file, prepare_folder
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
    kind: Kind | None
    """Of the folder written; None where a file is."""


EXPORTERS: dict[str, Exporter] = {}


def register_exporter(name: str, about: str, kind: Kind | None = None) -> Callable[[Write], Write]:
    """Decorator that makes a function available as a format."""

    def register(write: Write) -> Write:
        EXPORTERS[name] = Exporter(name, about, write, kind)
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
    result, out, exporter = Path(result), Path(out), EXPORTERS[name]
    folder = result if result.is_dir() else result.parent
    if exporter.kind is None:
        prepare_file(out, [folder, result, folder / "solution.json"])
    else:
        prepare_folder(out, exporter.kind, [result])
    exporter.write(load_solution(result), folder, out)

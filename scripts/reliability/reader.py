"""What a reader is to the campaign: a sound file, how it is spoilt, and who reads it."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .mutations import Mutate

Use = Callable[[Path], object]


@dataclass(frozen=True)
class Reader:
    """A file to be spoilt, and who reads it."""

    name: str
    make: Callable[[Path], None]
    """Writes sound files into a folder."""
    file: str
    """The one of them that is spoilt."""
    use: Use
    """Reads the folder's files; raises ``InputError`` or returns."""
    ways: Sequence[Mutate]
    share: float = 1.0
    """How often it is tried, relative to others."""


def cli(*arguments: object) -> None:
    """Run a command in this process.

    Raises:
        RuntimeError: the exit code is not documented for what a user can mend.
    """
    from typer.testing import CliRunner

    from mitsuba_endo.cli.main import app

    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exit_code not in (0, 1, 2, 3):
        raise RuntimeError(f"exit code {result.exit_code}: {result.stderr.strip()[-400:]}")
    lines = [line for line in result.stderr.splitlines() if not line.startswith("[ ")]
    if result.exit_code == 2 and len(lines) != 1:
        raise RuntimeError(f"{len(lines)} lines: {result.stderr[:400]}")


def made(name: str) -> Callable[[Path], None]:
    """Return a maker that copies what :mod:`.sound` made once for all."""
    from .sound import sound

    def make(folder: Path) -> None:
        shutil.copytree(sound(name), folder, dirs_exist_ok=True)

    return make

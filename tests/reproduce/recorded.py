"""A solver that records every file that its process opens, for the tests of the guard."""

import os
import sys
from pathlib import Path

opened: list[str] = []


def record() -> None:
    """Record from now on what this process opens."""

    def hook(event: str, arguments: tuple) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            opened.append(os.fsdecode(arguments[0]))

    sys.addaudithook(hook)


def solve(inputs: Path) -> tuple[float, list[str]]:
    """Calibrate and return the focal length and the files that were opened meanwhile."""
    from reproduce.methods import joint  # pyright: ignore[reportMissingImports]

    record()
    return joint(inputs).focals[0], list(opened)


def read_text(path: Path) -> str:
    """Read a file."""
    return path.read_text()

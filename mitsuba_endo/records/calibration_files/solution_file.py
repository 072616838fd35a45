"""The package's own solution and truth files."""

from pathlib import Path

from ...reading.regular import exists
from ..solution import Solution, load_solution
from .registry import register_calibration_format

NAMES = ("solution.json", "truth.json")


def _matches(path: Path) -> bool:
    """Take folders that hold one, and files of any name that is no other format's."""
    if path.is_dir():
        return any(exists(path / name) for name in NAMES)
    return path.suffix.lower() in (".json", "") or not exists(path)


@register_calibration_format("a solution folder or truth", _matches)
def read(path: Path) -> Solution:
    """Read ``solution.json`` or ``truth.json``."""
    return load_solution(path)

"""Whole calibrations in files of this and other programs, tried in turn."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError
from ..solution import Solution
from ..solution_checks import check_solution
from ..validation import validated

Matches = Callable[[Path], bool]
Read = Callable[[Path], Solution]


@dataclass(frozen=True)
class CalibrationFormat:
    """One program's way of writing cameras, projectors and their poses."""

    name: str
    matches: Matches
    """Tells, without reading it whole, whether a path is of this format."""
    read: Read


CALIBRATION_FORMATS: dict[str, CalibrationFormat] = {}
"""Every format, by the name that is told to the user, in the order in which they are tried."""


def register_calibration_format(name: str, matches: Matches) -> Callable[[Read], Read]:
    """Decorator that makes a reader available."""

    def register(read: Read) -> Read:
        CALIBRATION_FORMATS[name] = CalibrationFormat(name, matches, read)
        return read

    return register


def read_calibration(path: str | Path) -> tuple[Solution, str]:
    """Read a calibration of any format as a solution; values have no deviations if files do not.

    Returns:
        The solution, and the name of the format.

    Raises:
        InputError: no such file or folder, none of the formats, or damage.
    """
    path = Path(path)
    for form in CALIBRATION_FORMATS.values():
        if form.matches(path):
            with validated(str(path)):
                return check_solution(form.read(path), str(path)), form.name
    raise InputError(
        "holds no calibration", str(path), f"give one of {', '.join(CALIBRATION_FORMATS)}"
    )

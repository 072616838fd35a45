"""One input, and how it ended."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError

RIGHT, WARNED, REFUSED, WRONG = "right", "right, with a warning", "refused", "WRONG"
TOLD = "as it is written, and a warning names it"
SHOWN = 170
"""Characters of a sentence that the table shows."""


@dataclass(frozen=True)
class Ending:
    """What was read of an input."""

    error: float
    """Beside the truth, over what is allowed: above 1 it is wrong."""
    said: list[str] = field(default_factory=list)
    """Warnings."""


@dataclass(frozen=True)
class Case:
    """An input that people bring."""

    kind: str
    """Group in the table."""
    brings: str
    """The input in words, and the options given with it."""
    expected: str
    """``RIGHT``, ``WARNED``, ``TOLD`` or ``REFUSED``."""
    words: str
    """A part of the warning or refusal, which must name the cause."""
    run: Callable[[Path], Ending]
    """Write it into an empty folder and read it."""


@dataclass(frozen=True)
class Outcome:
    """How a case ended."""

    outcome: str
    said: str
    """The sentence that the reader sees, if there is one."""

    def agrees(self, case: Case) -> bool:
        """Tell whether this is what should be."""
        return self.outcome == case.expected and case.words in self.said


def outcome_of(case: Case, folder: Path) -> Outcome:
    """Run a case in an empty folder."""
    try:
        ending = case.run(folder)
    except InputError as error:
        return Outcome(REFUSED, str(error).replace(f"{folder}/", "").replace(str(folder), "."))
    said = "; ".join(ending.said).replace(f"{folder}/", "")
    if not ending.error <= 1:
        return Outcome(WRONG, said)
    warned = TOLD if case.expected == TOLD else WARNED
    return Outcome(warned if said else RIGHT, said)


def beside(found: NDArray[np.floating], truth: NDArray[np.floating], most: float) -> float:
    """Return how far maps (H, W, 2) are apart in the median, over ``most``; NaN = missing.

    Infinite if less than 60 % of the truth's pixels were found, or 1 % of those are far off.
    """
    known, wanted = np.isfinite(found).all(-1), np.isfinite(truth).all(-1)
    if found.shape != truth.shape or (known & wanted).sum() < 0.6 * wanted.sum():
        return np.inf
    apart = np.abs(found - truth)[known & wanted]
    far = (apart.max(1) > max(8 * most, 2)).mean() > 0.01
    return np.inf if far else float(np.median(apart, axis=0).max()) / most

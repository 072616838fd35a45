"""What can be evaluated: one entry for each kind of result."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from ..matching import MatchBy
from ..table import ErrorTable


class Evaluated(Protocol):
    """Errors of a result: to be saved, summarised and shown."""

    def save(self, path: str | Path) -> None:
        """Write the file that programs read."""
        ...

    def tables(self) -> list[ErrorTable]:
        """Return what a human reader is shown."""
        ...

    def summary(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        ...


Evaluate = Callable[[Path, Sequence[Path], MatchBy], Evaluated]


@dataclass(frozen=True)
class EvaluationKind:
    """One kind of result and how it is compared."""

    name: str
    takes: Callable[[Path], bool]
    """Tells whether a path holds a result of this kind."""
    run: Evaluate


KINDS: list[EvaluationKind] = []
"""Tried in this order: the last one takes whatever is a calibration."""


Run = TypeVar("Run", bound=Evaluate)


def register_evaluation(name: str, takes: Callable[[Path], bool]) -> Callable[[Run], Run]:
    """Decorator for a function of result, truths and how frames are matched.

    Kinds that are registered later are tried first, so that a special one need not know of others.
    """

    def register(run: Run) -> Run:
        KINDS.insert(0, EvaluationKind(name, takes, run))
        return run

    return register


def evaluate_result(
    result: str | Path, truths: Sequence[str | Path], match: MatchBy = "name"
) -> Evaluated:
    """Compare a result of any kind with its truth.

    Args:
        result: a solution folder or another kind that is registered.
        truths: one file or folder, or several.
        match: how frames are paired with those of the truth.

    Raises:
        InputError: something cannot be read, or frames cannot be paired.
    """
    path = Path(result)
    kind = next((kind for kind in KINDS if kind.takes(path)), KINDS[-1])
    return kind.run(path, [Path(truth) for truth in truths], match)

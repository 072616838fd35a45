"""Who sees to it that what a sequence has finished is not lost."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from .run import Run


class Keeper(Protocol):
    """Told by :func:`.run.run_sequence` how far it is; never in the middle of a frame."""

    def after_frame(self, run: "Run") -> None:
        """Take note that a frame was taken."""
        ...

    def at_end(self, run: "Run") -> None:
        """Take note of the end, also by Ctrl-C, before anything is made of what was recorded."""
        ...


@dataclass(frozen=True)
class Keepers:
    """Several, told one after the other."""

    each: Sequence[Keeper]

    def after_frame(self, run: "Run") -> None:
        for keeper in self.each:
            keeper.after_frame(run)

    def at_end(self, run: "Run") -> None:
        for keeper in self.each:
            keeper.at_end(run)

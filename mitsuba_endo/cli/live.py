"""Watching a calibration or a sequence in the viewer while it runs."""

import contextlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from .console import Session
from .options import HOST, PORT
from .view import announce

if TYPE_CHECKING:
    from ..records.rig import Rig
    from ..records.solution import Solution
    from ..show.viewer import LiveSequence, LiveView


View = TypeVar("View", "LiveView", "LiveSequence")


@dataclass(frozen=True)
class Watch(Generic[View]):
    """A viewer that is shown the iterations, or the frames."""

    view: View

    def end(self, solution: "Solution", output: Session) -> None:
        """Say how it ended; leave the viewer to who sits before it, until Ctrl-C."""
        from ..records.solution import Outcome
        from ..show.viewer import wait_for_interrupt

        self.view.end(solution.outcome.replace("_", " "))
        if solution.outcome is not Outcome.INTERRUPTED and sys.stdin.isatty():
            output.print("The viewer stays until Ctrl-C.")
            wait_for_interrupt()


@contextlib.contextmanager
def watching(live: bool, rig: "Rig", output: Session) -> Iterator["Watch[LiveView] | None"]:
    """Start a viewer of a calibration if ``live``, and end it with the block.

    Raises:
        InputError: the viewer is not installed.
    """
    if not live:
        yield None
        return
    from ..show.viewer import LiveView, running_server

    with running_server(HOST, PORT) as server:
        announce(server, True, output)
        yield Watch(LiveView(server, rig))


@contextlib.contextmanager
def watching_sequence(
    live: bool, rig: "Rig", output: Session
) -> Iterator["Watch[LiveSequence] | None"]:
    """Start a viewer of a sequence, as :func:`watching`."""
    if not live:
        yield None
        return
    from ..show.viewer import LiveSequence, running_server

    with running_server(HOST, PORT) as server:
        announce(server, True, output)
        yield Watch(LiveSequence(server, rig))

"""Watching a calibration in the viewer while it runs."""

import contextlib
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .console import Session
from .options import HOST, PORT
from .view import announce

if TYPE_CHECKING:
    from ..records.rig import Rig
    from ..records.solution import Solution
    from ..show.viewer import LiveView


@dataclass(frozen=True)
class Watch:
    """A viewer that is shown the iterations."""

    view: "LiveView"

    def end(self, solution: "Solution", output: Session) -> None:
        """Say how it ended; leave the viewer to who sits before it, until Ctrl-C."""
        from ..records.solution import Outcome
        from ..show.viewer import wait_for_interrupt

        self.view.end(solution.outcome.replace("_", " "))
        if solution.outcome is not Outcome.INTERRUPTED and sys.stdin.isatty():
            output.print("The viewer stays until Ctrl-C.")
            wait_for_interrupt()


@contextlib.contextmanager
def watching(live: bool, rig: "Rig", output: Session) -> Iterator[Watch | None]:
    """Start a viewer if ``live``, and end it with the block.

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

"""The folder beside a sequence's own that holds, while it runs, what was finished."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from ..errors import InputError
from ..files import atomic_folder
from ..folder_mark import Kind, read_mark, remove_marked
from ..outputs import check_folder
from ..records.trajectory import save_frames
from ..sequence.frame_reading import FrameReading
from ..sequence.resume import FILE, save_state, unfinished_of
from ..sequence.run import Run
from .solution_folder import save_rig
from .trajectory_files import FRAMES, save_trajectories

EVERY = 20.0
"""Seconds of work that may be lost. Chosen: saving takes below one."""
SHARE = 20.0
"""Saving takes at most one part in so many of the time."""


class UnfinishedFolder:
    """Saves the state of a run, and its poses so far, from time to time.

    Everything in the folder is of one moment, whenever the program is killed. Without Ctrl-C it is
    gone once the sequence's own folder is complete.
    """

    def __init__(
        self, out: str | Path, marks: Sequence[str], reading: FrameReading, every: float = EVERY
    ) -> None:
        """Write nothing yet.

        Args:
            out: the folder that the sequence will be written to.
            marks: of the frames that have come so far, which grows.
            reading: how they are read.
            every: so many seconds.
        """
        self.path = unfinished_of(out)
        self._marks, self._reading, self._every = marks, reading, every
        self._next = monotonic() + every

    def after_frame(self, run: Run) -> None:
        """Save if it is time."""
        began = monotonic()
        if began < self._next:
            return
        self.at_end(run)
        taken = monotonic() - began
        self._next = monotonic() + max(self._every, SHARE * taken)

    def at_end(self, run: Run) -> None:
        """Save."""
        with atomic_folder(self.path, Kind.UNFINISHED) as folder:
            recorded = run.recorded
            save_state(folder / FILE, run, self._marks[: run.taken], self._reading)
            save_frames(folder / FRAMES, recorded.rows)
            placed = [row for row in recorded.rows if not row.lost and row.part == 0]
            save_trajectories(folder, placed)
            save_rig(folder / "rig.yaml", recorded.rig)

    def copy_state(self, path: Path) -> None:
        """Copy the state into a file."""
        shutil.copyfile(self.path / FILE, path)

    def remove(self) -> None:
        """Remove the folder: what it holds is in the sequence's own."""
        mark = read_mark(self.path)
        if mark is not None:
            remove_marked(self.path, mark)


def check_unfinished(out: str | Path, resumed: str | Path | None) -> None:
    """Refuse, before any work, to replace what another run has finished.

    Args:
        out: the folder that a sequence is to be written to.
        resumed: the folder of the run that it goes on with.

    Raises:
        InputError: beside ``out`` lies the state of a run that is not resumed, or something else.
    """
    path = unfinished_of(out)
    check_folder(path, Kind.UNFINISHED)
    if not path.is_dir() or not any(path.iterdir()):
        return
    same = resumed is not None and path.resolve() in (
        Path(resumed).resolve(),
        unfinished_of(resumed).resolve(),
    )
    if not same:
        raise InputError(
            "holds what an unfinished run has found", str(path),
            f"go on from there with --resume {out}, or remove it",
        )  # fmt: skip

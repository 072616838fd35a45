"""A sequence's state on disk, from which it goes on as if it had not been stopped."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..reading.regular import is_file
from ..records.object_file import load_objects, save_objects
from ..records.rig import Rig
from .frame_reading import FrameReading
from .options import SequenceOptions
from .run import OnFrame, Recorded, Run

FILE = "state.npz"
SUFFIX = ".unfinished"
"""Of the folder, beside the one that is to be written, that holds the state meanwhile."""
_WHAT = "state of a sequence of this version"
_TODO = "go through the sequence anew without --resume"


@dataclass(frozen=True, eq=False)
class Past:
    """What an earlier run left."""

    state: dict[str, Any]
    marks: list[str]
    """What tells each of its frames from others, see :class:`.inputs.Feed`."""
    reading: FrameReading
    where: str

    def go_on(self, rig: Rig, options: SequenceOptions, on_frame: OnFrame | None = None) -> Run:
        """Return the run, ready for the frame after its last.

        Raises:
            InputError: it was of another rig, or with other options.
        """
        before: SequenceOptions = replace(self.state["_options"], vertices=options.vertices)
        if self.state["recorded"].rig != rig:
            raise self._differs("was of another rig", "give the same rig")
        for field in fields(options):
            was, is_ = getattr(before, field.name), getattr(options, field.name)
            if was != is_:
                raise self._differs(f"was with {field.name} {was}, not {is_}", f"give {was} again")
        return Run.resumed(self.state | {"_options": options}, on_frame)

    def check_reading(self, reading: FrameReading) -> None:
        """Refuse another way from files to maps.

        Raises:
            InputError: names the option.
        """
        for field in fields(reading):
            was, is_ = (getattr(r, field.name) for r in (self.reading, reading))
            if was != is_:
                raise self._differs(
                    f"was with {field.name} {was}, not {is_}", "give the same option"
                )

    def _differs(self, how: str, todo: str) -> InputError:
        return InputError(f"the sequence to go on with {how}", self.where, f"{todo} or start anew")


def save_state(path: str | Path, run: Run, marks: Sequence[str], reading: FrameReading) -> None:
    """Write the state of a run.

    Args:
        path: the file.
        run: between two frames.
        marks: of its frames so far.
        reading: how they were read.

    Raises:
        InputError: the file cannot be written.
    """
    save_objects(path, {"state": run.state(), "marks": list(marks), "reading": reading})


def load_state(folder: str | Path) -> Past:
    """Read the state that lies in a sequence's folder.

    Of a sequence that was killed it lies in the folder of the same name with ``.unfinished``, which
    is the newer one where there are both.

    Raises:
        InputError: there is none, it is damaged, or another version wrote it.
    """
    folder = Path(folder)
    candidates = [unfinished_of(folder) / FILE, folder / FILE]
    path = next((candidate for candidate in candidates if is_file(candidate)), None)
    if path is None:
        raise InputError(
            "no such file", str(candidates[-1]), "name the folder of an earlier sequence"
        )
    objects = load_objects(path, _WHAT, _TODO)
    if not _is_state(objects):
        raise InputError(f"is not a readable {_WHAT}", str(path), _TODO)
    return Past(objects["state"], objects["marks"], objects["reading"], str(path))


def _is_state(objects: dict[str, Any]) -> bool:
    """Tell whether objects are those of :func:`save_state`, as far as they are looked at first."""
    state, marks = objects.get("state"), objects.get("marks")
    if not isinstance(state, dict) or not isinstance(marks, list):
        return False
    recorded = state.get("recorded")
    return (
        isinstance(state.get("_options"), SequenceOptions)
        and isinstance(recorded, Recorded)
        and isinstance(recorded.rig, Rig)
        and isinstance(recorded.rows, list)
        and isinstance(objects.get("reading"), FrameReading)
        and all(isinstance(mark, str) for mark in marks)
    )


def unfinished_of(folder: str | Path) -> Path:
    """Return the folder that holds the state while ``folder`` is not written yet."""
    folder = Path(folder)
    return folder.with_name(folder.name + SUFFIX)

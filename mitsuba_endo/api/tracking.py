"""A sequence in one call, and what it found."""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .. import backend
from ..errors import InputError, shown
from ..fusion import FusedMesh
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..records.solution import Solution
from ..records.trajectory import FrameRow
from ..sequence.frame_reading import FrameReading
from ..sequence.inputs import Feed, feed_of_maps, frames_of
from ..sequence.options import SequenceOptions
from ..sequence.outcome import SequenceResult, outcome_of
from ..sequence.resume import Past, load_state, save_state
from ..sequence.run import Run, run_sequence
from ..show.sequence_folder import write_sequence_folder
from ..show.sequence_views import SequenceViews
from .inputs import FrameInput, RigInput, as_correspondences, as_frames, as_rig
from .result import Result

Floats = NDArray[np.float64]


def track(
    captures: FrameInput | Iterable[FrameInput],
    rig: RigInput,
    *,
    pattern: str | None = None,
    refine: bool = True,
    map_convention: str = "",
    mask: str | Path | None = None,
    resume: str | Path | None = None,
    on_frame: Callable[[FrameRow], None] | None = None,
    options: SequenceOptions | None = None,
) -> "TrackedSequence":
    """Track camera and projector through the frames of a video, onto one surface.

    Ctrl-C ends it after the frame that it is at; what was found until then is given back.

    Args:
        captures: in the order in which they were taken: a video, a folder of images or of maps, or
            several files; or maps as arrays (H, W, 2) of pattern pixels with NaN = missing, or as
            records, also from a generator, of which one is held at a time.
        rig: what is known: a rig file's path, its contents, or its record.
        pattern: in the images; default the coded grid.
        refine: whether decoded coordinates are refined on their images.
        map_convention: of files and arrays, the command's ``--map-convention``; records are right.
        mask: image whose white pixels are used, for all frames, or a folder of one per frame.
        resume: folder of an earlier sequence to go on with; the captures begin with its frames.
        on_frame: called with every frame once it is placed or lost.
        options: how to go through the frames.

    Raises:
        InputError: something that cannot be used; says what and what to do.
    """
    backend.ensure()
    record, options = as_rig(rig), options or SequenceOptions()
    past = None if resume is None else load_state(resume)
    reading = FrameReading(pattern, refine, map_convention, None if mask is None else str(mask))
    feed = _feed(captures, record, reading, past)
    run = past and past.go_on(record, options, on_frame)
    last = _LastRun()
    recorded = run_sequence(feed, record, options, on_frame, run=run, keeper=last)

    def state(path: Path) -> None:
        save_state(path, last.run, feed.marks[: last.run.taken], reading)

    return TrackedSequence(outcome_of(recorded, options.vertices), state)


def _feed(
    captures: FrameInput | Iterable[FrameInput], rig: Rig, reading: FrameReading, past: Past | None
) -> Feed:
    """Return the frames of files, or of arrays as they come."""
    if isinstance(captures, str | Path | CorrespondenceMap | np.ndarray | list | tuple):
        captures = as_frames(captures)
        paths = [Path(c) for c in captures if isinstance(c, str | Path)]
        if paths and len(paths) == len(captures):
            return frames_of(paths, rig, reading=reading, past=past)
    if (reading.pattern, reading.refine) != (None, True):
        raise InputError("is for files of images, and maps are given", "pattern", "leave it out")
    reading.check(rig, maps=True)
    return feed_of_maps(_maps(captures, rig, reading.map_convention), reading, past)


def _maps(
    captures: Iterable[FrameInput], rig: Rig, map_convention: str
) -> Iterator[CorrespondenceMap]:
    for k, capture in enumerate(captures):
        if isinstance(capture, str | Path):
            what = "is a path among maps"
            raise InputError(what, f"captures[{k}]", "give paths alone or maps alone")
        (map_,) = as_correspondences([capture], rig, None, True, map_convention)
        own = isinstance(capture, CorrespondenceMap)
        yield map_ if own else CorrespondenceMap(map_.q, f"frame_{k}")


class _LastRun:
    """Keeps the run, whose state is saved with the result."""

    run: Run

    def after_frame(self, run: Run) -> None:
        self.run = run

    at_end = after_frame


class TrackedSequence:
    """Poses of all frames and a surface, as :func:`mitsuba_endo.track` gives them.

    The world is the first placed camera. Lengths are in :attr:`unit`.
    """

    def __init__(self, result: SequenceResult, state: Callable[[Path], None] | None = None) -> None:
        """Wrap what was found.

        Args:
            result: by a sequence.
            state: writes a file from which the sequence can go on.
        """
        self.found = result
        self._state = state

    @property
    def frames(self) -> list[FrameRow]:
        """All frames in order: poses with deviations, or why a frame was lost."""
        return self.found.rows

    @property
    def lost(self) -> list[FrameRow]:
        """Frames without a pose; ``lost`` of each says why."""
        return self.found.lost

    @property
    def solution(self) -> Solution:
        """Focal length, verdict, lost frames and some keyframes, as in ``solution.json``."""
        return self.found.solution

    @property
    def unit(self) -> str:
        """``mm``, or ``baseline`` where the scale is not known."""
        return self.found.units

    @property
    def verdict(self) -> str:
        """What was measured and what was not, in words, a line each."""
        return "\n".join(self.solution.verdict)

    @property
    def warnings(self) -> list[str]:
        """What to look at before relying on the numbers."""
        return self.solution.warnings

    @property
    def surface(self) -> FusedMesh | None:
        """The mesh of the part with the most frames; None where nothing hangs together."""
        return self.found.surfaces[self.found.main]

    @property
    def keyframes(self) -> Result | None:
        """Some keyframes as a calibration's result, in which distances can be measured."""
        shown = self.found.keyframes
        return None if shown is None else Result(shown, self.found.rig)

    def depth(self, frame: int) -> Floats:
        """Return the depth (H, W) of a frame: z in its camera's frame; NaN = no surface there.

        Raises:
            InputError: as :meth:`points`.
        """
        return self.points(frame)[..., 2]

    def points(self, frame: int) -> Floats:
        """Return the surface points (H, W, 3) that a frame's pixels see, in its camera's frame.

        Args:
            frame: its number, from 0.

        Raises:
            InputError: there is no such frame, it was lost, or its part has no surface.
        """
        count = len(self.frames)
        if not (isinstance(frame, int | np.integer) and -count <= frame < count):
            what = f"there is no frame {shown(frame)}"
            raise InputError(what, "frame", f"give 0 to {count - 1}")
        return self._views.points(self.frames[frame])

    def save(self, folder: str | Path) -> None:
        """Write the folder that the command ``sequence`` writes; ``resume`` goes on from it.

        Raises:
            InputError: the folder holds other files, or cannot be written.
        """
        write_sequence_folder(folder, self.found, self._state)

    def __repr__(self) -> str:
        count, lost = len(self.frames), len(self.lost)
        return f"<mitsuba_endo.TrackedSequence: {count} frames, {lost} lost>"

    @cached_property
    def _views(self) -> SequenceViews:
        return SequenceViews(self.found)

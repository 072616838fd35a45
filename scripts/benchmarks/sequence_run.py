"""A recording tracked and written as the command does, with what it costs."""

import resource
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.sequence_errors import evaluate_sequence
from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from mitsuba_endo.evaluate.tracked_frames import TrackedFrames
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.trajectory import FrameRow
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.outcome import SequenceResult, outcome_of
from mitsuba_endo.sequence.run import run_sequence
from mitsuba_endo.show.read_sequence import read_sequence_folder
from mitsuba_endo.show.sequence_folder import write_sequence_folder
from tests.sequences import Recording


@dataclass(frozen=True, eq=False)
class SequenceRun:
    """What was found, read again from the folder that was written, and what it took."""

    result: SequenceResult
    tracked: TrackedFrames
    seconds: float
    """Wall-clock time from the first frame to the last file, without the making of maps."""
    processor: float
    """Time of all cores, likewise, s."""
    peak: float
    """Memory of the process, MB."""
    growth: float
    """Of that before a frame, MB a frame, in the second half."""

    @property
    def rows(self) -> Sequence[FrameRow]:
        return self.tracked.rows

    @property
    def scale_std(self) -> float:
        """Return the median stated deviation of a baseline, % of it.

        The first one is given, so that this is how well lengths are known from frame to frame.
        """
        told = [
            _along(row.projector_std[3:], row.projector_from_camera)
            for row in self.rows
            if row.projector_std is not None and row.projector_from_camera is not None
        ]
        return 100 * float(np.median(told))


def _along(std: NDArray[np.float64], pose: RigidTransform) -> float:
    """Return the deviation of a translation's length over the length, axes taken as independent."""
    return float(np.linalg.norm(std * pose.t) / np.linalg.norm(pose.t) ** 2)


@dataclass
class TimedFeed:
    """Makes maps when they are asked for, and keeps the time that takes apart."""

    frames: Iterable[Incoming]
    seconds: float = 0.0
    processor: float = 0.0
    memory: list[float] = field(default_factory=list)
    """Peak memory so far, MB, before each frame."""

    def __iter__(self) -> Iterator[Incoming]:
        source = iter(self.frames)
        while True:
            began = perf_counter(), process_time()
            frame = next(source, None)
            self.memory.append(_peak())
            self.seconds += perf_counter() - began[0]
            self.processor += process_time() - began[1]
            if frame is None:
                return
            yield frame


def run_recording(recording: Recording, nothing: range = range(0)) -> SequenceRun:
    """Track a recording of which some frames show nothing; the making of its maps is not timed."""
    feed = TimedFeed(_maps(recording, nothing))
    return run_frames(feed, recording.rig(), feed)


def run_frames(frames: Iterable[Incoming], rig: Rig, apart: TimedFeed | None = None) -> SequenceRun:
    """Track frames; what ``apart`` took is not counted."""
    began = perf_counter(), process_time()
    apart = apart or TimedFeed(())
    result = outcome_of(run_sequence(frames, rig))
    with tempfile.TemporaryDirectory() as folder:
        write_sequence_folder(Path(folder) / "out", result)
        seconds = perf_counter() - began[0] - apart.seconds
        processor = process_time() - began[1] - apart.processor
        tracked = read_sequence_folder(Path(folder) / "out")
    return SequenceRun(result, tracked, seconds, processor, _peak(), _growth(apart.memory))


def errors(found: SequenceRun, truth: Recording) -> SequenceMetrics:
    """Compare with the truth as the command ``evaluate`` does."""
    return evaluate_sequence(found.tracked, truth.truth, truth.surface)


def _maps(recording: Recording, nothing: range) -> Iterator[Incoming]:
    for k in range(len(recording)):
        if k in nothing:
            yield Unread(f"frame{k:04d}", "nothing is decoded")
        else:
            map_ = recording.map(k)
            yield CorrespondenceMap(map_.q, map_.name)


def _peak() -> float:
    """Return the peak memory of this process, MB (Linux counts in kB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _growth(memory: list[float]) -> float:
    half = len(memory) // 2
    return (memory[-1] - memory[half]) / max(len(memory) - 1 - half, 1) if memory else float("nan")

"""What is to be solved and where its optimisation ended: what the stages hand to each other."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from ..geometry.cameras import CameraModel
from ..initialisation.result import Start
from ..records.checkpoint import Checkpoint
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..records.solution import LeftOut
from .frames.centre_search import centre_is_assumed, resumed_centre, searched_centre
from .frames.initial_poses import without_faults
from .history import History
from .inference.observability import Direction
from .minimisers.minimise import Progress
from .minimisers.result import OptimisationResult
from .options import Options
from .unknowns.layout import Layout, make_layout


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be solved, under one projection model."""

    maps: list[CorrespondenceMap]
    camera: CameraModel
    rig: Rig
    law: str
    options: Options
    resume: Checkpoint | None = None
    """Earlier calibration to go on with."""
    timings: dict[str, float] = field(default_factory=dict)
    """Seconds of every stage, filled in while solving."""
    history: History = field(default_factory=History)
    """How the last optimisation went, likewise."""
    notes: tuple[str, ...] = ()
    """What was assumed before it began."""
    starts: Mapping[str, Start] = field(default_factory=dict)
    """Starts, by the frame's name, that need not be searched for again."""

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time of a block to a stage's."""
        began = time.perf_counter()
        yield
        self.timings[stage] = self.timings.get(stage, 0.0) + time.perf_counter() - began

    def layout(self, frames: int) -> Layout:
        """Return the layout of the unknowns of so many frames."""
        return make_layout(self.rig, frames)


@dataclass(frozen=True, eq=False)
class Optimised:
    """Where an optimisation of a job ended."""

    maps: list[CorrespondenceMap]
    """The frames that are part of it."""
    left_out: list[LeftOut]
    notes: list[str]
    result: OptimisationResult
    predicted: list[Direction]
    """What its start left free."""
    refuted: str = ""
    """Why the sharing plan is wrong, where most frames contradict it."""


def with_centre(job: Job, progress: Progress) -> Job:
    """Return the job with the projector's centre looked for, where a lens has none given."""
    if not centre_is_assumed(job.rig, job.law):
        return job
    progress(0.0, "Looking for the projector's centre")
    with job.timed("start"):
        if job.resume is not None:
            (rig, note), starts = resumed_centre(job.resume, job.rig), {}
        else:
            sound, _ = without_faults(job.maps, job.rig)
            layout = job.layout(len(job.maps))
            rig, note, starts = searched_centre(sound, job.camera, job.rig, layout, job.options)
    return replace(job, rig=rig, notes=(note,), starts=starts)

"""The stages from maps to a fit, for one frame, frames with their own surfaces, or a shared one."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from ..geometry.cameras import CameraModel
from ..records.calibration import TraceRow
from ..records.checkpoint import Checkpoint
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..records.solution import LeftOut, Outcome
from ..start.registration import RangeImage, Registration, register_frames
from ..start.result import Start
from .cost.drift import drift_prior
from .cost.problem import Problem
from .fit import Fit
from .history import History
from .optimise.optimum import Optimum
from .optimise.polish import smooth_surfaces
from .optimise.run import OnIteration, Progress, optimise
from .options import Options
from .prepare.agreement import agreements, worst
from .prepare.frames import (
    common_start,
    solve_alone,
    usable_starts,
    without_faults,
    without_repeats,
)
from .prepare.joint import FrameStart, at_identity, extended, joint_problem, seen_from_first
from .prepare.resume import resumed_maps, resumed_problem
from .prepare.single import separate_surfaces
from .statistics.foresight import foreseen_directions
from .statistics.observability import Direction
from .statistics.uncertainty import uncertainty
from .unknowns.plan import make_plan
from .unknowns.state import State

_MAX_EXTENSIONS = 10
"""Times that the surface may grow while cameras that started at one place spread."""


@dataclass(frozen=True, eq=False)
class Job:
    """What is to be solved, under one projector law."""

    maps: list[CorrespondenceMap]
    camera: CameraModel
    rig: Rig
    law: str
    options: Options
    resume: Checkpoint | None = None
    """Earlier calibration to go on with."""
    timings: dict[str, float] = field(default_factory=dict)
    """Seconds of every stage, filled in while solving."""
    foreseen: list[Direction] = field(default_factory=list)
    """What the start of the last optimisation leaves free, likewise."""
    history: History = field(default_factory=History)
    """How the last optimisation went, likewise."""

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time of a block to a stage's."""
        began = time.perf_counter()
        yield
        self.timings[stage] = self.timings.get(stage, 0.0) + time.perf_counter() - began


@dataclass(frozen=True, eq=False)
class Found:
    """Where an optimisation of a job ended."""

    maps: list[CorrespondenceMap]
    """The frames that are part of it."""
    left_out: list[LeftOut]
    notes: list[str]
    optimum: Optimum


def search(job: Job, say: Progress) -> Found:
    """Search for a start and optimise.

    Raises:
        InputError: no frame can be used, or the plan contradicts itself.
    """
    make_plan(job.rig, len(job.maps))  # a contradiction is told before any work
    if job.resume is not None:
        return _resumed(job, job.resume, say)
    if len(job.maps) > 1 and job.rig.share.surface == "shared":
        return _shared_surface(job, say)
    return _own_surfaces(job, say)


def _resumed(job: Job, checkpoint: Checkpoint, say: Progress) -> Found:
    maps = resumed_maps(checkpoint, job.maps)
    plan = make_plan(job.rig, len(maps))
    say(0.1, "Optimising")
    with job.timed("optimise"):
        problem, state = resumed_problem(checkpoint, maps, job.camera, plan)
        optimum = _optimise(job, problem, state, _reporter(job, say, 0.1), checkpoint.stage)
    left_out = [
        LeftOut(name=m.name, reason="it was not part of the calibration resumed")
        for m in job.maps
        if m not in maps
    ]
    return Found(maps, left_out, [], optimum)


def _own_surfaces(job: Job, say: Progress) -> Found:
    say(0.05, "Searching for a start")
    with job.timed("start"):
        maps, starts, left_out = _starts(job)
        plan = make_plan(job.rig, len(maps))
        if len(maps) > 1 and plan.blocks["projector_pose"] != "per_frame":
            starts = common_start(maps, starts, job.camera)
    say(0.4, "Optimising")
    notes = list(dict.fromkeys(note for s in starts for note in s.notes))
    with job.timed("optimise"):
        problem, state = separate_surfaces(maps, starts, job.camera, plan, job.law, job.options)
        optimum = _optimise(job, problem, state, _reporter(job, say, 0.4))
    return Found(maps, left_out, notes, optimum)


def _shared_surface(job: Job, say: Progress) -> Found:
    """Solve every frame alone, register them, and optimise all with one surface."""
    alone, left_out = _solved_alone(job, say)
    say(0.5, "Registering the frames")
    with job.timed("registration"):
        placed = _place(job, alone)
    kept = [k for k, p in enumerate(placed) if p.reliable]
    left_out += [
        LeftOut(name=alone[k].name, reason=_named(p.reason, alone))
        for k, p in enumerate(placed)
        if not p.reliable
    ]
    notes = list(dict.fromkeys(note for k in kept for note in alone[k].notes))
    say(0.6, "Optimising all frames")
    with job.timed("optimise"):
        found = _optimise_joint(job, [alone[k] for k in kept], [placed[k] for k in kept], say)
    return replace(found, left_out=left_out + found.left_out, notes=notes + found.notes)


def _solved_alone(job: Job, say: Progress) -> tuple[list[FrameStart], list[LeftOut]]:
    """Start and solve every frame alone; name those that cannot be used."""
    say(0.05, "Searching for a start")
    with job.timed("start"):
        maps, starts, left_out = _starts(job)
    say(0.3, "Solving every frame alone")
    with job.timed("frames"):
        plan = make_plan(job.rig, len(maps))
        return solve_alone(maps, starts, job.camera, plan, job.law, job.options), left_out


def _starts(job: Job) -> tuple[list[CorrespondenceMap], list[Start], list[LeftOut]]:
    """Start the frames that can be used; name the others."""
    sound, faulty = without_faults(job.maps, job.rig)
    unique, repeated = without_repeats(sound)
    maps, starts, failed = usable_starts(unique, job.camera, job.rig, job.law, job.options)
    return maps, starts, [*faulty, *repeated, *failed]


def _place(job: Job, alone: list[FrameStart]) -> list[Registration]:
    if job.options.cameras == "identity":
        return at_identity(len(alone))
    rays = job.camera.rays(job.camera.pixel_grid())
    images = [RangeImage(rays, a.range, job.camera) for a in alone if a.range is not None]
    return register_frames(images, seed=job.options.seed)


def _named(reason: str, alone: list[FrameStart]) -> str:
    """Replace frame numbers of a registration's reason by names."""
    for k, frame in reversed(list(enumerate(alone))):
        reason = reason.replace(f"against frame {k}:", f"against {frame.name}:")
    return reason


def _optimise_joint(
    job: Job, alone: list[FrameStart], placed: list[Registration], say: Progress
) -> Found:
    """Optimise all frames; leave out one that contradicts the others and try again."""
    left_out: list[LeftOut] = []
    while True:
        plan = make_plan(job.rig, len(alone))
        problem, state = joint_problem(alone, seen_from_first(placed), plan, job.law)
        optimum = _optimise(job, problem, state, _reporter(job, say, 0.6))
        found = agreements(alone, optimum) if len(alone) > 1 else []
        wrong = None if optimum.outcome is Outcome.INTERRUPTED else worst(found)
        if wrong is None:
            break
        left_out.append(LeftOut(name=alone[wrong].name, reason=found[wrong].reason))
        alone = [a for k, a in enumerate(alone) if k != wrong]
        placed = [p for k, p in enumerate(placed) if k != wrong]
    doubts = [f"do not rely on frame {a.name}: {a.reason}" for a in found if a.doubtful]
    names = {a.name for a in alone}
    return Found([m for m in job.maps if m.name in names], left_out, doubts, optimum)


def _optimise(
    job: Job, problem: Problem, state: State, report: OnIteration, stage: int = 0
) -> Optimum:
    """Optimise, with a surface that grows to where moving cameras look."""
    with job.timed("observability"):
        job.foreseen[:] = foreseen_directions(problem, state, job.options.finish)
    extra = drift_prior(job.rig, problem.plan)
    job.history.begin(problem, state)
    report = job.history.recording(report)
    optimum = optimise(problem, state, job.options, extra, report, stage)
    for _ in range(_MAX_EXTENSIONS):
        if problem.plan.surface != "shared" or optimum.outcome is not Outcome.CONVERGED:
            break
        grown = extended(optimum)
        if grown is None:
            break
        trace = optimum.trace
        job.history.go_on(grown[0])
        optimum = optimise(*grown, job.options, extra, report)
        optimum = replace(optimum, trace=_continued(trace, optimum.trace))
    return optimum


def _continued(before: list[TraceRow], after: list[TraceRow]) -> list[TraceRow]:
    """Return the trace of an optimisation that went on with another surface."""
    last = before[-1]
    return before + [
        replace(row, iteration=last.iteration + row.iteration, seconds=last.seconds + row.seconds)
        for row in after
    ]


def _reporter(job: Job, say: Progress, begin: float) -> OnIteration:
    """Return a callback that shows the iterations in the rest of the progress bar."""

    def report(row: TraceRow, _state: State) -> None:
        share = min(row.iteration / job.options.max_iterations, 1.0)
        focal = f", f = {row.focal:.2f} px" if row.focal is not None else ""
        say(begin + (1 - begin) * share, f"Optimising (iteration {row.iteration}{focal})")

    return report


def finish(job: Job, found: Found, say: Progress) -> Fit:
    """Smooth the surface to be reported and tell how well everything is known."""
    say(0.0, "Computing standard deviations")
    with job.timed("surface"):
        reported = smooth_surfaces(found.optimum, job.options)
    with job.timed("uncertainty"):
        known = uncertainty(found.optimum, reported, job.options.jackknife)
    given = [m.name for m in job.maps]
    return Fit(job.law, found.maps, found.left_out, given, found.optimum, reported, known,
               found.notes, job.timings, job.foreseen, job.history.snapshots)  # fmt: skip

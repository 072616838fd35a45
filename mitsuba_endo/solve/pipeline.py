"""The stages from maps to a fit, for one frame, frames with their own surfaces, or a shared one."""

from collections.abc import Sequence
from dataclasses import replace

from ..initialisation.registration import RangeImage, Registration, register_frames
from ..initialisation.result import Start
from ..records.calibration import TraceRow
from ..records.checkpoint import Checkpoint
from ..records.correspondence import CorrespondenceMap
from ..records.solution import LeftOut, Outcome
from .conclusion import stopping
from .costs.objective import Problem, make_problem
from .costs.registry import priors_of
from .frames.initial_poses import (
    OnFrame,
    common_start,
    usable_starts,
    without_faults,
    without_repeats,
)
from .frames.joint import at_identity, extended, joint_problem, seen_from_first
from .frames.restart import with_restarts
from .frames.resume import resumed_maps, resumed_problem
from .frames.separate_surfaces import separate_surfaces
from .frames.single_frames import solve_alone
from .history import History
from .inference.fit import FrameSolution
from .inference.frame_consistency import consistencies, doubtful_frames, plan_refuted, worst
from .inference.observability import Direction
from .inference.predicted_observability import predicted_directions
from .job import Job, Optimised
from .minimisers.minimise import OnIteration, Progress, minimise
from .minimisers.result import OptimisationResult
from .unknowns.state import State

NOT_REACHED = "the calibration was stopped before its turn"
"""Why a frame is left out that was not yet solved when the user stopped."""
_MAX_EXTENSIONS = 10
"""Times that the surface may grow while cameras that started at one place spread."""


def optimise(job: Job, progress: Progress) -> Optimised:
    """Search for a start and optimise.

    Raises:
        InputError: no frame can be used, or the plan contradicts itself.
    """
    job.layout(len(job.maps))  # a contradiction is told before any work
    if job.resume is not None:
        return _resumed(job, job.resume, progress)
    if len(job.maps) > 1 and job.rig.share.surface == "shared":
        return _shared_surface(job, progress)
    return _own_surfaces(job, progress)


def optimise_again(job: Job, other: OptimisationResult, progress: Progress) -> OptimisationResult:
    """Optimise under the job's projection model from where another model's result ended.

    The unknowns are the job's own: what another model needed as one, such as a lens's centre that
    was not given, stays as this job's rig has it.
    """
    old = other.problem
    layout = job.layout(old.layout.frames)
    of_frames = {
        name: [other.state.at(name, k) for k in range(layout.frames)] for name in old.layout.owners
    }
    state = layout.state(other.state.surfaces, of_frames)
    terms = [*old.smoothness, *priors_of(job.rig, layout)]
    problem = make_problem(old.observed, old.surfaces, state, layout, job.law, terms)
    aside = replace(job, history=History())  # what is kept is how the model's own way went
    return _optimise(aside, problem, state, _reporter(job, progress, 0.1))[0]


def _resumed(job: Job, checkpoint: Checkpoint, progress: Progress) -> Optimised:
    maps = resumed_maps(checkpoint, job.maps)
    progress(0.1, "Optimising")
    with job.timed("optimise"):
        problem, state = resumed_problem(
            checkpoint, maps, job.camera, job.rig, job.layout(len(maps))
        )
        result, predicted = _optimise(
            job, problem, state, _reporter(job, progress, 0.1), last_stage=checkpoint.last_stage
        )
    left_out = [
        LeftOut(name=m.name, reason="it was not part of the calibration resumed")
        for m in job.maps
        if m not in maps
    ]
    return Optimised(maps, left_out, [], result, predicted)


def _own_surfaces(job: Job, progress: Progress) -> Optimised:
    progress(0.05, "Searching for a start")
    with job.timed("start"):
        maps, starts, left_out = _starts(
            job, _frames_of(progress, 0.05, 0.4, "Searching for a start")
        )
        layout = job.layout(len(maps))
        if len(maps) > 1 and layout.sharing("projector_pose") != "per_frame":
            share_focal = layout.sharing("focal") != "per_frame"
            starts = common_start(maps, starts, job.camera, share_focal=share_focal)
    progress(0.4, "Optimising")
    notes = list(dict.fromkeys(note for s in starts for note in s.notes))
    with job.timed("optimise"):
        predicted: list[Direction] = []

        def solve(starts: Sequence[Start]) -> OptimisationResult:
            problem, state = separate_surfaces(
                maps, starts, job.camera, job.rig, layout, job.law, job.options
            )
            result, predicted[:] = _optimise(job, problem, state, _reporter(job, progress, 0.4))
            return result

        result = with_restarts(maps, starts, job.camera, solve)
    return Optimised(maps, left_out, notes, result, predicted)


def _shared_surface(job: Job, progress: Progress) -> Optimised:
    """Solve every frame alone, register them, and optimise all with one surface.

    Where the user stops while frames are solved alone, those that are done are brought together.
    """
    alone, left_out = _solved_alone(job, progress)
    stopped = any(left.reason == NOT_REACHED for left in left_out)
    progress = stopping(progress) if stopped else progress
    progress(0.5, "Registering the frames")
    with job.timed("registration"):
        registered = _register(job, alone)
    kept = [k for k, p in enumerate(registered) if p.reliable]
    left_out += [
        LeftOut(name=alone[k].name, reason=_named(p.reason, alone))
        for k, p in enumerate(registered)
        if not p.reliable
    ]
    notes = list(dict.fromkeys(note for k in kept for note in alone[k].notes))
    progress(0.6, "Optimising all frames")
    with job.timed("optimise"):
        report = _stop if stopped else _reporter(job, progress, 0.6)
        done = _optimise_joint(job, [alone[k] for k in kept], [registered[k] for k in kept], report)
    return replace(done, left_out=left_out + done.left_out, notes=notes + done.notes)


def _solved_alone(job: Job, progress: Progress) -> tuple[list[FrameSolution], list[LeftOut]]:
    """Start and solve every frame alone; name those that cannot be used."""
    progress(0.05, "Searching for a start")
    with job.timed("start"):
        maps, starts, left_out = _starts(
            job, _frames_of(progress, 0.05, 0.3, "Searching for a start")
        )
    progress(0.3, "Solving every frame alone")
    with job.timed("frames"):
        layout = job.layout(len(maps))
        told = _frames_of(progress, 0.3, 0.5, "Solving every frame alone")
        alone = solve_alone(maps, starts, job.camera, job.rig, layout, job.law, job.options, told)
    missing = [LeftOut(name=m.name, reason=NOT_REACHED) for m in maps[len(alone) :]]
    return alone, [*left_out, *missing]


def _stop(_row: TraceRow, _state: State) -> None:
    """End an optimisation after its first iteration, as the user's own interrupt would."""
    raise KeyboardInterrupt


def _frames_of(progress: Progress, begin: float, end: float, step: str) -> OnFrame:
    """Return a callback that tells the frames of a step, of a part of the progress bar."""

    def told(frame: int, count: int) -> None:
        of = f", frame {frame} of {count}" if count > 1 else ""
        progress(begin + (end - begin) * (frame - 1) / count, f"{step}{of}")

    return told


def _starts(
    job: Job, on_frame: OnFrame
) -> tuple[list[CorrespondenceMap], list[Start], list[LeftOut]]:
    """Start the frames that can be used; name the others."""
    sound, faulty = without_faults(job.maps, job.rig)
    unique, repeated = without_repeats(sound)
    maps, starts, failed = usable_starts(
        unique,
        job.camera,
        job.rig,
        job.layout(len(unique)),
        job.law,
        job.options,
        job.starts,
        on_frame,
    )
    return maps, starts, [*faulty, *repeated, *failed]


def _register(job: Job, alone: Sequence[FrameSolution]) -> list[Registration]:
    if job.options.cameras == "identity":
        return at_identity(len(alone))
    images = [RangeImage(job.camera.grid_rays, a.range, job.camera)
              for a in alone if a.range is not None]  # fmt: skip
    return register_frames(images, seed=job.options.seed)


def _named(reason: str, alone: Sequence[FrameSolution]) -> str:
    """Replace frame numbers of a registration's reason by names."""
    for k, frame in reversed(list(enumerate(alone))):
        reason = reason.replace(f"against frame {k}:", f"against {frame.name}:")
    return reason


def _optimise_joint(
    job: Job, alone: list[FrameSolution], registered: list[Registration], report: OnIteration
) -> Optimised:
    """Optimise all frames; leave out one that contradicts the others and try again."""
    left_out: list[LeftOut] = []
    while True:  # but not for long: each frame left out costs a solution
        problem, state = _joint_problem(job, alone, seen_from_first(registered))
        result, predicted = _optimise(job, problem, state, report)
        judged = consistencies(alone, result) if len(alone) > 1 else []
        wrong = None if result.outcome is Outcome.INTERRUPTED else worst(judged)
        refuted = plan_refuted(judged, problem.layout, len(left_out))
        if wrong is None or refuted:
            break
        left_out.append(LeftOut(name=alone[wrong].name, reason=judged[wrong].reason))
        alone = [a for k, a in enumerate(alone) if k != wrong]
        registered = [p for k, p in enumerate(registered) if k != wrong]
    refuted = refuted if wrong is not None else ""
    names = {a.name for a in alone}
    maps = [m for m in job.maps if m.name in names]
    doubts = [] if refuted else doubtful_frames(judged)
    return Optimised(maps, left_out, doubts, result, predicted, refuted)


def _joint_problem(
    job: Job, alone: Sequence[FrameSolution], registered: Sequence[Registration]
) -> tuple[Problem, State]:
    """Build the joint problem on the kind of surface that the options ask for."""
    layout = job.layout(len(alone))
    if job.options.surface == "mesh":
        from .frames.joint_mesh import joint_mesh_problem  # takes a tenth of a second to load

        return joint_mesh_problem(alone, registered, job.camera, job.rig, layout, job.law)
    return joint_problem(alone, registered, job.rig, layout, job.law)


def _optimise(
    job: Job, problem: Problem, state: State, report: OnIteration, *, last_stage: bool = False
) -> tuple[OptimisationResult, list[Direction]]:
    """Optimise, with a surface that grows to where moving cameras look."""
    with job.timed("observability"):
        predicted = predicted_directions(problem, state, job.options.finish)
    job.history.begin(problem, state)
    report = job.history.recording(report)
    result = minimise(problem, state, job.options, report, last_stage=last_stage)
    for _ in range(_MAX_EXTENSIONS):
        shared = problem.layout.frames > 1 and problem.layout.surfaces == 1
        if not shared or result.outcome is not Outcome.CONVERGED:
            break
        grown = extended(result)
        if grown is None:
            break
        trace = result.trace
        job.history.go_on(grown[0])
        result = minimise(*grown, job.options, report)
        result = replace(result, trace=_continued(trace, result.trace))
    return result, predicted


def _continued(before: list[TraceRow], after: list[TraceRow]) -> list[TraceRow]:
    """Return the trace of an optimisation that went on with another surface."""
    last = before[-1]
    return before + [
        replace(row, iteration=last.iteration + row.iteration, seconds=last.seconds + row.seconds)
        for row in after
    ]


def _reporter(job: Job, progress: Progress, begin: float) -> OnIteration:
    """Return a callback that shows the iterations in the rest of the progress bar."""

    def report(row: TraceRow, _state: State) -> None:
        share = min(row.iteration / job.options.max_iterations, 1.0)
        focal = f", f = {row.focal:.2f} px" if row.focal is not None else ""
        progress(begin + (1 - begin) * share, f"Optimising (iteration {row.iteration}{focal})")

    return report

"""Calibration: from correspondence maps and a rig to projector, poses and surface."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from threadpoolctl import threadpool_limits

from .. import backend
from ..geometry.projection_models import PROJECTION_MODELS
from ..records.calibration import Calibration
from ..records.checkpoint import Checkpoint
from ..records.consistency import as_maps
from ..records.correspondence import CorrespondenceMap
from ..records.history import Observe
from ..records.rig import AUTO_LAW, Rig
from ..records.solution import Outcome
from ..sanity.examine import examine
from .conclusion import infer, stopping
from .contradictions import check_surface, unused_deviations
from .frames.resume import check_rig
from .frames.weights import balanced
from .history import History
from .inference.fit import Fit
from .inference.model_choice import cheaper, choose_law
from .job import Job, Optimised, with_centre
from .minimisers.minimise import Progress, minimiser_of
from .options import Options
from .pipeline import optimise, optimise_again
from .reporting.assemble import assemble


def calibrate(
    maps: Iterable[CorrespondenceMap],
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
    resume: Checkpoint | None = None,
    observe: Observe | None = None,
) -> Calibration:
    """Calibrate a projector from correspondence maps; starts Mitsuba if nobody has.

    Args:
        maps: one for each frame.
        rig: what is known, and which unknowns the frames share.
        options: how to solve.
        progress: called with the share of the work done and the name of the step.
        resume: an earlier calibration of these maps to go on with, of the same camera and pattern;
            its projection model is kept.
        observe: called after every iteration with where it stands, lengths in baselines.

    Returns:
        The solution with the surface, the rendered maps and the trace of the optimisation.

    Raises:
        InputError: maps or rig that cannot be used; says what to do.
    """
    options = options or Options()
    report = progress or (lambda _share, _step: None)
    minimiser_of(options)  # an unknown one is told before any work
    examined = examine(as_maps(maps), rig)
    check_surface(options, rig, len(examined.maps), resume)
    if resume is not None:
        check_rig(resume, rig)
    backend.ensure_derivatives()
    camera = rig.camera.to_model()
    # One thread: the matrices are too small for two, which then wait for each other.
    with threadpool_limits(1, "blas"), examined.told_on_failure():
        weighted, laws = balanced(examined.maps), _laws(rig, resume)
        jobs = [Job(weighted, camera, rig, law, options, resume, history=History(observe))
                for law in laws]  # fmt: skip
        fits = solve_each(jobs, report)
        report(0.9, "Assembling the solution")
        fit, evidence, warnings = choose_law(fits)
        warnings = [*unused_deviations(rig, fit.result.problem.layout, options), *warnings]
        return assemble(fit, camera, rig, options, evidence, [*examined.warnings, *warnings])


def _laws(rig: Rig, resume: Checkpoint | None) -> list[str]:
    """Return the projection models to solve under."""
    if resume is not None:
        return [resume.law]
    return list(PROJECTION_MODELS) if rig.projector.law == AUTO_LAW else [rig.projector.law]


def solve_each(jobs: Sequence[Job], progress: Progress) -> list[Fit]:
    """Solve the same maps under each projection model, and from where the others ended too.

    A model is compared at its best: where the data say little, its own start may lie in a valley
    that leads elsewhere, and another model's solution is a start as good as its own.

    Returns:
        One fit a model; the interrupted one alone where the user stopped.
    """
    parts = 2 * len(jobs) if len(jobs) > 1 else 1  # an only one has no others to start from
    last = _part(progress, parts, parts)
    end = _part(stopping(progress), parts, parts)
    jobs = [with_centre(job, _part(progress, i, parts)) for i, job in enumerate(jobs)]
    done: list[Optimised] = []
    for i, job in enumerate(jobs):
        done.append(optimise(job, _part(progress, i, parts)))
        if done[-1].result.outcome is Outcome.INTERRUPTED:
            return [infer(job, done[-1], end)]
    for i, job in enumerate(jobs):
        done[i] = _from_others(job, i, done, _part(progress, len(jobs) + i, parts))
        if done[i].result.outcome is Outcome.INTERRUPTED:
            return [infer(job, done[i], end)]
    return [infer(job, d, last) for job, d in zip(jobs, done, strict=True)]


def _from_others(job: Job, index: int, done: Sequence[Optimised], progress: Progress) -> Optimised:
    """Return the better of where a model ended by itself and from where the others ended."""
    best = own = done[index]
    for other in (d for k, d in enumerate(done) if k != index):
        if [m.name for m in other.maps] != [m.name for m in own.maps]:
            continue
        result = optimise_again(job, other.result, progress)
        if result.outcome is Outcome.INTERRUPTED:
            return replace(best, result=replace(best.result, outcome=Outcome.INTERRUPTED))
        if cheaper(result, best.result):
            best = replace(own, result=result)
    return best


def _part(progress: Progress, index: int, parts: int) -> Progress:
    """Return a progress callback that fills one part of the first nine tenths."""
    return lambda share, step: progress(0.9 * min(index + share, parts) / parts, step)

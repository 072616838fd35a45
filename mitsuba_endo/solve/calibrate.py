"""Calibration: from correspondence maps and a rig to projector, poses and surface."""

from dataclasses import replace

from threadpoolctl import threadpool_limits

from ..geometry.laws import LAWS
from ..records.calibration import Calibration
from ..records.checkpoint import Checkpoint
from ..records.consistency import check_maps
from ..records.correspondence import CorrespondenceMap
from ..records.history import Observe
from ..records.rig import AUTO_LAW, Rig
from ..records.solution import Outcome
from .fit import Fit
from .history import History
from .optimise.run import Progress
from .options import Options
from .pipeline import Found, Job, finish, search
from .prepare.resume import checkpoint_of
from .prepare.weights import balanced
from .results.assemble import assemble
from .results.law_evidence import cheaper, choose_law


def calibrate(
    maps: list[CorrespondenceMap],
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
    resume: Checkpoint | None = None,
    observe: Observe | None = None,
) -> Calibration:
    """Calibrate a projector from correspondence maps.

    Args:
        maps: one for each frame.
        rig: what is known, and which unknowns the frames share.
        options: how to solve.
        progress: called with the share of the work done and the name of the step.
        resume: an earlier calibration of these maps to go on with; its law is kept.
        observe: called after every iteration with where it stands, lengths in baselines.

    Returns:
        The solution with the surface, the rendered maps and the trace of the optimisation.

    Raises:
        InputError: maps or rig that cannot be used; says what to do.
    """
    options = options or Options()
    say = progress or (lambda _share, _step: None)
    check_maps(maps, rig)
    camera = rig.camera.to_model()
    laws = (
        [resume.law]
        if resume
        else list(LAWS)
        if rig.projector.law == AUTO_LAW
        else [rig.projector.law]
    )
    # One thread: the matrices are too small for two, which then wait for each other.
    with threadpool_limits(1, "blas"):
        given = balanced(maps)
        jobs = [Job(given, camera, rig, law, options, resume, history=History(observe))
                for law in laws]  # fmt: skip
        fits = solve_each(jobs, say)
        say(0.9, "Assembling the solution")
        fit, evidence, warnings = choose_law(fits)
        return assemble(fit, camera, rig, options, evidence, warnings)


def solve_each(jobs: list[Job], say: Progress) -> list[Fit]:
    """Solve the same maps under each law, and under each from where the others ended too.

    A law is compared at its best: where the data say little, its own start may lie in a valley
    that leads elsewhere, and another law's solution is a start as good as its own.

    Returns:
        One fit a law; the interrupted one alone where the user stopped.
    """
    parts = 2 * len(jobs) if len(jobs) > 1 else 1  # one law has no others to start from
    done = _part(say, parts, parts)
    stopping = _part(lambda share, step: say(share, f"Stopping: {step.lower()}"), parts, parts)
    found: list[Found] = []
    for i, job in enumerate(jobs):
        found.append(search(job, _part(say, i, parts)))
        if found[-1].optimum.outcome is Outcome.INTERRUPTED:
            return [finish(job, found[-1], stopping)]
    for i, job in enumerate(jobs):
        found[i] = _from_others(job, i, found, _part(say, len(jobs) + i, parts))
        if found[i].optimum.outcome is Outcome.INTERRUPTED:
            return [finish(job, found[i], stopping)]
    return [finish(job, f, done) for job, f in zip(jobs, found, strict=True)]


def _from_others(job: Job, law: int, found: list[Found], say: Progress) -> Found:
    """Return the better of where a law ended by itself and from where the other laws ended."""
    best = own = found[law]
    for other in (f for k, f in enumerate(found) if k != law):
        if [m.name for m in other.maps] != [m.name for m in own.maps]:
            continue
        start = replace(checkpoint_of(other.optimum), law=job.law, stage=0)
        alike = replace(job, resume=start, foreseen=[], history=History())
        again = search(alike, say).optimum
        if again.outcome is Outcome.INTERRUPTED:
            return replace(best, optimum=replace(best.optimum, outcome=Outcome.INTERRUPTED))
        if cheaper(again, best.optimum):
            best = replace(own, optimum=again)
    return best


def _part(say: Progress, index: int, parts: int) -> Progress:
    """Return a progress callback that fills one part of the first nine tenths."""
    return lambda share, step: say(0.9 * min(index + share, parts) / parts, step)

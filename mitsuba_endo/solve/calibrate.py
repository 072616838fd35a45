"""Calibration: from correspondence maps and a rig to projector, poses and surface."""

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
from .pipeline import Job, solve
from .results.assemble import assemble
from .results.law_evidence import choose_law


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
        fits: list[Fit] = []
        for i, law in enumerate(laws):
            job = Job(maps, camera, rig, law, options, resume, history=History(observe))
            fits.append(solve(job, _part(say, i, len(laws))))
            if fits[-1].optimum.outcome is Outcome.INTERRUPTED:
                fits = fits[-1:]  # the user wants to go on with this one
                break
        say(0.9, "Assembling the solution")
        fit, evidence, warnings = choose_law(fits)
        return assemble(fit, camera, rig, options, evidence, warnings)


def _part(say: Progress, index: int, parts: int) -> Progress:
    """Return a progress callback that fills one part of the first nine tenths."""
    return lambda share, step: say(0.9 * (index + share) / parts, step)

"""From where an optimisation ended to a fit: how well everything is known."""

from dataclasses import replace

from ..records.solution import Outcome
from .inference.covariance import uncertainty
from .inference.fit import Fit
from .inference.model_error.analysis import check_model
from .job import Job, Optimised
from .minimisers.minimise import Progress
from .minimisers.surface_smoothing import smooth_surfaces


def stopping(progress: Progress) -> Progress:
    """Return a progress callback for what is still done after the user has stopped."""
    return lambda share, step: progress(share, f"Stopping: {step.lower()}")


def infer(job: Job, done: Optimised, progress: Progress) -> Fit:
    """Smooth the surface to be reported and tell how well everything is known.

    Where the user stops, what was found is kept, with the formal standard deviations alone.

    Raises:
        KeyboardInterrupt: the user stops for the second time.
    """
    try:
        return _inferred(job, done, progress)
    except KeyboardInterrupt:
        if done.result.outcome is Outcome.INTERRUPTED:
            raise
    quick = replace(job, options=replace(job.options, check_model=False, jackknife=False))
    stopped = replace(done, result=replace(done.result, outcome=Outcome.INTERRUPTED))
    return _inferred(quick, stopped, stopping(progress))


def _inferred(job: Job, done: Optimised, progress: Progress) -> Fit:
    result, model = done.result, None
    if job.options.check_model:
        progress(0.0, "Testing the model")
        with job.timed("model"):
            decoded = all(m.correlation_px is not None for m in done.maps)
            model = check_model(result, job.rig, decoded=decoded)
    progress(0.5, "Computing standard deviations")
    with job.timed("surface"):
        reported = smooth_surfaces(result, job.options)
    with job.timed("uncertainty"):
        deviations = uncertainty(result, reported, job.options.jackknife)
    if model is not None:
        model = replace(model, understated=max(deviations.sigma / result.noise.sigma, 1.0))
    given, notes = [m.name for m in job.maps], [*job.notes, *done.notes]
    return Fit(job.law, done.maps, done.left_out, given, result, reported, model, deviations, notes,
               job.timings, done.predicted, job.history.snapshots, done.refuted)  # fmt: skip

"""``law: auto``. Oracle: the law with which the maps were made."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import PROJECTION_MODELS
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve import pipeline
from mitsuba_endo.solve.calibrate import calibrate, solve_each
from mitsuba_endo.solve.inference.fit import Fit
from mitsuba_endo.solve.inference.model_choice import choose_law
from mitsuba_endo.solve.job import Job, Optimised
from mitsuba_endo.solve.minimisers.minimise import Progress
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.options import Options
from tests.range_scenes import height_field
from tests.solve.views import POSE, Views, look, projector_poses, relief_surface, steps

pytestmark = pytest.mark.usefixtures("llvm")


def with_both_laws(views: Views) -> Calibration:
    rig = views.rig()
    projector = rig.projector.model_copy(update={"law": "auto"})
    return calibrate(
        views.maps, rig.model_copy(update={"projector": projector}), Options(jackknife=False)
    )


@pytest.mark.parametrize("law", ["pinhole", "direction_cosine"])
def test_law_of_the_data_is_chosen(law: str) -> None:
    views = look(relief_surface(), steps(2), projector_poses(2), law=law)
    solution = with_both_laws(views).solution
    other = {"pinhole": "direction_cosine", "direction_cosine": "pinhole"}[law]
    evidence = solution.law_evidence
    assert solution.projector.law == evidence["chosen"] == law
    assert evidence["decided"]
    assert evidence["conclusion"].startswith(f"the residuals support {law} over {other}")
    assert f"Projection model: {evidence['conclusion']}." in solution.verdict
    assert evidence["noise_px"][law] < evidence["noise_px"][other]
    assert evidence["standard_errors"] > 5
    assert not any("cannot tell" in w for w in solution.warnings)


def narrow_and_noisy() -> Views:
    """A narrow view of a nearly flat sheet, and much noise: the laws differ by less than it.

    Within 8 degrees of the axis a direction cosine is f (sin - tan) = 0.6 px from a pinhole, and
    most of that another focal length makes up for.
    """
    sheet = height_field(lambda x, y: 70 + 0.1 * x + np.sin(x / 9) + 0.5 * np.cos(y / 7))
    views = look(sheet, [RigidTransform.identity()], [POSE], noise=6.0, outliers=0.0)
    q = views.maps[0].q.astype(np.float64)
    middle = np.full_like(q, np.nan)
    middle[30:54, 40:68] = q[30:54, 40:68]
    return views.with_map(0, middle)


def test_data_that_cannot_tell() -> None:
    solution = with_both_laws(narrow_and_noisy()).solution
    assert not solution.law_evidence["decided"]
    assert "cannot tell" in solution.law_evidence["conclusion"]
    assert any("give projector.law if it is known" in w for w in solution.warnings)


def fits(views: Views) -> list[Fit]:
    jobs = [
        Job(views.maps, views.camera, views.rig(), law, Options(jackknife=False))
        for law in PROJECTION_MODELS
    ]
    return solve_each(jobs, lambda _share, _step: None)


def ended(fit: Fit, outcome: Outcome, step: float) -> Fit:
    """The fit as if it had ended otherwise, its last step ``step`` standard deviations long."""
    trace = [*fit.result.trace[:-1], replace(fit.result.trace[-1], step=step)]
    return replace(fit, result=replace(fit.result, outcome=outcome, trace=trace))


def test_interrupt_in_the_second_try_keeps_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the law's own optimum, said to be interrupted; no other law is finished."""
    found: list[Optimised] = []

    def optimise(job: Job, say: Progress) -> Optimised:
        found.append(pipeline.optimise(job, say))
        return found[-1]

    def interrupted(_job: Job, other: OptimisationResult, _say: Progress) -> OptimisationResult:
        return replace(other, outcome=Outcome.INTERRUPTED)

    monkeypatch.setattr("mitsuba_endo.solve.calibrate.optimise", optimise)
    monkeypatch.setattr("mitsuba_endo.solve.calibrate.optimise_again", interrupted)
    (fit,) = fits(narrow_and_noisy())
    assert fit.result.outcome is Outcome.INTERRUPTED
    assert fit.law == next(iter(PROJECTION_MODELS))
    assert fit.result.evaluation is found[0].result.evaluation
    assert fit.result.cost == found[0].result.cost


@pytest.mark.parametrize("which", [0, 1])
def test_unconverged_fit_of_data_that_cannot_tell(which: int) -> None:
    """Oracle: the converged fit is taken, whichever costs less; no difference is negative."""
    found = fits(narrow_and_noisy())
    found[which] = ended(found[which], Outcome.MAX_ITERATIONS, 0.1)
    found[1 - which] = ended(found[1 - which], Outcome.CONVERGED, 0.1)
    chosen, evidence, warnings = choose_law(found)
    assert chosen is found[1 - which]
    assert evidence["chosen"] == chosen.law
    assert evidence["log_likelihood_difference"] >= 0
    assert evidence["standard_errors"] >= 0
    assert not evidence["decided"]
    assert warnings


def test_unconverged_rival_decides_nothing_while_it_may_still_gain() -> None:
    """Oracle: the same fits; a rival a long way from its optimum might become as good."""
    right, wrong = fits(look(relief_surface(), steps(1), projector_poses(1), outliers=0.0))
    near = choose_law([right, ended(wrong, Outcome.STALLED, 1e-3)])[1]
    assert near["decided"]
    assert near["chosen"] == "pinhole"
    far_rival = ended(wrong, Outcome.MAX_ITERATIONS, near["log_likelihood_difference"])
    chosen, far, warnings = choose_law([right, far_rival])
    assert chosen is right
    assert not far["decided"]
    assert far["standard_errors"] > 0
    assert "had not converged" in far["conclusion"]
    assert "had not converged" in warnings[0]

"""Levenberg-Marquardt on one frame: it finds the truth from both starts, with gross errors."""

import numpy as np
import pytest

from mitsuba_endo.initialisation.plane import plane_start
from mitsuba_endo.initialisation.search import search_start
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.inference.covariance import uncertainty
from mitsuba_endo.solve.minimisers.levenberg_marquardt import LevenbergMarquardt
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.minimisers.surface_smoothing import smooth_surfaces
from mitsuba_endo.solve.options import Options
from tests.rigs import Rig, with_noise, with_outliers
from tests.solve.problems import (
    NOISE,
    PROJECTION_MODELS,
    errors,
    problem_of,
    small_rig,
    solved,
)

NOISE_SCALE = NoiseScale(float("inf"), "tukey")


def from_start(rig: Rig, start: str) -> OptimisationResult:
    """Optimise from a start that knows nothing of the truth but the projector's centre."""
    if start == "plane":
        # The published start: front-parallel, the focal length 10 % off, the plane 14 % too near.
        guess = rig.projector.with_(focal=300.0)
        found = plane_start(rig.q, rig.camera, guess, distance=60 / rig.baseline)
    else:
        found = search_start(rig.q, rig.camera, rig.unknown_projector, rig.size)
    return minimise(*problem_of([rig], starts=[found]), Options())


def within(result: OptimisationResult, rig: Rig, deviations: float) -> None:
    known = uncertainty(result, smooth_surfaces(result, Options()), jackknife=False)
    z = errors(result, rig) / np.sqrt(np.diag(known.formal))
    assert np.abs(z).max() < deviations
    assert known.sigma == pytest.approx(NOISE, rel=0.04)


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", PROJECTION_MODELS)
class TestOptimum:
    @pytest.mark.parametrize("start", ["plane", "search"])
    def test_is_the_truth(self, law: str, start: str):
        """Oracle: the truth, within five stated standard deviations; 2 % gross errors."""
        rig = small_rig(law)
        noisy = with_outliers(with_noise(rig, NOISE, 3), 0.02, 4)
        result = from_start(noisy, start)
        assert result.outcome == Outcome.CONVERGED
        within(result, rig, 5)

    def test_bears_many_gross_errors(self, law: str):
        """Oracle: as above with 30 % of the map replaced by noise over the whole pattern."""
        rig = small_rig(law)
        noisy = with_outliers(with_noise(rig, NOISE, 5), 0.3, 6)
        result = from_start(noisy, "search")
        assert result.outcome == Outcome.CONVERGED
        within(result, rig, 5)
        (focal,) = result.state.focals
        assert focal == pytest.approx(rig.projector.focal, rel=3e-3)

    def test_is_exact_without_noise(self, law: str):
        """Oracle: the truth; triangles instead of the curved sheet leave 1e-5 of focal length."""
        rig = small_rig(law)
        result = solved(rig)
        assert result.outcome == Outcome.CONVERGED
        assert np.abs(errors(result, rig)).max() < 3e-5

    def test_does_not_depend_on_the_start(self, law: str):
        """Oracle: the optimum from the truth, to a part of the tolerance of 0.1 deviations."""
        noisy = with_noise(small_rig(law), NOISE, 7)
        a, b = from_start(noisy, "plane"), from_start(noisy, "search")
        known = uncertainty(a, a, jackknife=False)
        gap = errors(a, noisy) - errors(b, noisy)
        assert np.abs(gap / np.sqrt(np.diag(known.formal))).max() < 0.5


@pytest.mark.usefixtures("llvm")
class TestCourse:
    def test_is_traced(self):
        """Oracle: one row an iteration; the cost falls while the scale of the loss stands."""
        result = from_start(with_noise(small_rig("pinhole"), NOISE, 3), "plane")
        assert [row.iteration for row in result.trace] == list(range(1, len(result.trace) + 1))
        assert result.trace[-1].focal == pytest.approx(330, rel=0.01)
        raw = [row.cost * (row.scale_px**2) for row in result.trace]
        for before, after in zip(result.trace, result.trace[1:], strict=False):
            if before.scale_px == after.scale_px:
                assert after.cost <= before.cost * (1 + 1e-12)
        assert len(raw) > 3

    def test_says_when_it_was_stopped_by_the_limit(self):
        """Oracle: the limit."""
        noisy = with_noise(small_rig("pinhole"), NOISE, 3)
        problem, state = problem_of([noisy])
        state = state.with_surfaces(0 * state.surfaces[0] + np.median(state.surfaces[0]))
        result = minimise(problem, state, Options(max_iterations=2))
        assert result.outcome == Outcome.MAX_ITERATIONS
        assert len(result.trace) == 2

    def test_keeps_what_it_has_when_interrupted(self):
        """Oracle: the state of the iteration in which the user stopped it."""
        problem, state = problem_of([with_noise(small_rig("pinhole"), NOISE, 3)])
        states = []

        def stop(_row: object, at: object) -> None:
            states.append(at)
            raise KeyboardInterrupt

        result = LevenbergMarquardt(0.1, 60).run(problem, state, NOISE_SCALE, stop)
        assert result.outcome == Outcome.INTERRUPTED
        assert result.state is states[-1]

    def test_of_an_interrupt_before_anything_was_done_is_none(self, monkeypatch):
        """Oracle: the interrupt reaches the caller."""
        problem, state = problem_of([with_noise(small_rig("pinhole"), NOISE, 3)])

        def interrupted(_solver: object, _now: object) -> None:
            raise KeyboardInterrupt

        monkeypatch.setattr(LevenbergMarquardt, "step", interrupted)
        with pytest.raises(KeyboardInterrupt):
            LevenbergMarquardt(0.1, 60).run(problem, state, NOISE_SCALE)

"""What errors of given values do to estimates.

Oracles: the law of total variance, by simulation of linear problems; and calibrations of exact
views with one given value changed by one standard deviation of a careful calibration.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import cast as typed

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.solve import conclusion
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.inference.model_error.analysis import check_model
from mitsuba_endo.solve.inference.model_error.extended import Extended, extend
from mitsuba_endo.solve.inference.model_error.nuisance import doubtful, nuisance
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.options import Options

from ..rigs import bumpy_sheet, cast, lopsided_camera
from .problems import POSE

FOCAL = 410.0


@dataclass(frozen=True, eq=False)
class Linear:
    """y = X x + N n + noise of variance one, fitted with n = 0."""

    X: NDArray[np.float64]
    N: NDArray[np.float64]

    def extended(self, y: NDArray[np.float64]) -> tuple[NDArray[np.float64], Extended]:
        """Return the fitted x and the normal equations with the columns of n."""
        x = np.linalg.lstsq(self.X, y, rcond=None)[0]
        J = np.column_stack([self.X, self.N])
        solved = np.arange(J.shape[1]) < self.X.shape[1]
        layout = SimpleNamespace(slots={("n", 0): slice(self.X.shape[1], J.shape[1])})
        found = Extended(
            typed(OptimisationResult, None), typed(object, layout), typed(object, None), [],
            J.T @ J, J.T @ (self.X @ x - y), [], solved,
        )  # pyright: ignore[reportArgumentType]  # fmt: skip
        return x, found


def test_the_mean_square_error_is_that_of_the_prior_on_average() -> None:
    """The mean of Q + m m^T over maps is P: errors are as large as stated."""
    rng = np.random.default_rng(0)
    problem = Linear(rng.normal(size=(30, 3)), rng.normal(size=(30, 2)))
    P = np.array([[0.5, 0.1], [0.1, 0.2]])
    root = {"n": np.linalg.inv(np.linalg.cholesky(P))}
    known = np.linalg.inv(problem.X.T @ problem.X)
    errors, stated = [], []
    for _ in range(4000):
        x, n = rng.normal(size=3), rng.multivariate_normal([0, 0], P)
        y = problem.X @ x + problem.N @ n + rng.normal(size=30)
        found, extended = problem.extended(y)
        doubt = nuisance(extended, root, 1.0, widen=False)
        errors.append((found - x) ** 2)
        stated.append(np.diag(known + doubt.covariance + np.outer(doubt.shift, doubt.shift)))
    S = known @ problem.X.T @ problem.N
    np.testing.assert_allclose(np.mean(errors, 0), np.diag(known + S @ P @ S.T), rtol=0.1)
    np.testing.assert_allclose(np.mean(stated, 0), np.diag(known + S @ P @ S.T), rtol=0.1)


def test_a_prior_that_the_data_contradict_becomes_wider() -> None:
    """A value off by 30 deviations: the predicted shift is the error."""
    rng = np.random.default_rng(1)
    problem = Linear(rng.normal(size=(300, 3)), rng.normal(size=(300, 2)))
    x, n = rng.normal(size=3), np.array([0.3, 0.0])
    y = problem.X @ x + problem.N @ n + 0.01 * rng.normal(size=300)
    found, extended = problem.extended(y)
    doubt = nuisance(extended, {"n": np.eye(2) / 0.01}, 0.01**2, widen=True)
    # Moving the unknowns by the shift mends them.
    np.testing.assert_allclose(found + doubt.shift, x, atol=0.005)


@cache
def fitted() -> tuple[Rig, CorrespondenceMap, OptimisationResult]:
    """Return a right calibration and what its check is given."""
    camera = lopsided_camera(96, 72)
    projector = projector_model("direction_cosine", FOCAL, (250.0, 205.0))
    seen = cast(camera, projector, (512, 400), POSE, bumpy_sheet(70.0, (0.2, -0.1), 6.0, 4))
    noise = 0.1 * np.random.default_rng(5).standard_normal(seen.q.shape)
    map_ = CorrespondenceMap(q=(seen.q + noise).astype(np.float32), name="a")
    rig = Rig.model_validate({
        "camera": {
            "width": 96, "height": 72, "K": np.array(camera.K).tolist(),
            "distortion": list(camera.distortion),
        },
        "projector": {
            "law": "direction_cosine", "width": 512, "height": 400, "centre": [250.0, 205.0]
        },
        "scale": {"baseline": seen.baseline},
    })  # fmt: skip
    kept: list[OptimisationResult] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            conclusion, "check_model",
            lambda r, g, *, decoded: kept.append(r) or check_model(r, g, decoded=decoded),
        )  # fmt: skip
        calibrate([map_], rig)
    return rig, map_, kept[0]


def _camera_centre(rig: dict, sign: int) -> None:
    rig["camera"]["K"][0][2] += 0.3 * sign


def _k1(rig: dict, sign: int) -> None:
    rig["camera"]["distortion"][0] += 0.002 * sign


def _centre(rig: dict, sign: int) -> None:
    rig["projector"]["centre"][0] += 1.0 * sign


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize(
    ("change", "block", "step"),
    [
        (_camera_centre, "camera_centre", [0.3, 0.0]),
        (_k1, "camera_distortion", [0.002, 0, 0, 0, 0]),
        (_centre, "centre", [1.0, 0.0]),
    ],
)
def test_an_error_moves_the_focal_length_as_predicted(
    change: Callable[[dict, int], None], block: str, step: list[float]
) -> None:
    """Oracle: calibrating with the value too large and too small."""
    rig, map_, result = fitted()
    extended = extend(result, rig, [])
    column = np.zeros((len(extended.g), 1))
    column[extended.layout.slots[block, 0], 0] = step
    moved = extended.directions(column)[0][extended.solved, 0]
    predicted = moved[result.problem.layout.slots["focal", 0]][0]
    logarithms = []
    for sign in (1, -1):
        wrong = rig.model_dump()
        change(wrong, sign)
        again = calibrate([map_], Rig.model_validate(wrong), Options(check_model=False)).solution
        assert isinstance(again.projector.focal.value, float)
        logarithms.append(np.log(again.projector.focal.value))
    assert (logarithms[0] - logarithms[1]) / 2 == pytest.approx(predicted, rel=0.1)


@pytest.mark.usefixtures("llvm")
def test_default_priors_are_those_of_careful_calibrations() -> None:
    """Stated deviations replace them, and alone count where nothing is wrong."""
    rig, _, result = fitted()
    roots = doubtful(rig, result.problem.layout, stated=False)
    assert set(roots) == {
        "centre", "aspect", "distortion", "camera_focal", "camera_centre", "camera_distortion"
    }  # fmt: skip
    np.testing.assert_allclose(np.linalg.inv(roots["camera_centre"]), np.eye(2))
    assert doubtful(rig, result.problem.layout, stated=True) == {}
    stated = rig.camera.model_copy(update={"K_std": [1.0, 1.0, 0.25, 0.5]})
    known = rig.model_copy(update={"camera": stated})
    roots = doubtful(known, result.problem.layout, stated=True)
    assert set(roots) == {"camera_focal", "camera_centre"}
    np.testing.assert_allclose(np.linalg.inv(roots["camera_centre"]), np.diag([0.25, 0.5]))

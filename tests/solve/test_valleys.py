"""Weak relief: valleys in which steps are short. Oracle: the truth, and a cost that falls no more.

A pinhole projector and three planes that differ by a few degrees: the focal length is known to
half a percent, and from a wrong one the way to it is long.
"""

import numpy as np
import pytest

from mitsuba_endo.initialisation.given_pose import known_start
from mitsuba_endo.initialisation.search import search_start
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.options import Options
from tests.rigs import Rig, Surface, plane, with_noise
from tests.solve.problems import map_of, problem_of, rig_file, small_rig

pytestmark = pytest.mark.usefixtures("llvm")

PLANE = plane((0.2, -0.1, 1.0), 70.0)


def shallow_box(share: float) -> Surface:
    """Three faces whose normals and distances differ by a share of a box's."""
    first = np.array([0.2, -0.1, 1.0]) / np.linalg.norm([0.2, -0.1, 1.0])
    faces = [((0.2, -0.1, 1.0), 70.0), ((1.0, 0.0, 0.35), 75.0), ((0.05, 1.0, 0.4), 80.0)]
    bent = [
        plane(
            tuple(first + share * (np.array(n) / np.linalg.norm(n) - first)),
            70 + share * (d - 70),
        )
        for n, d in faces
    ]
    return lambda rays: np.nanmin([p(rays) for p in bent], axis=0)


def noisy(surface: Surface, seed: int) -> Rig:
    return with_noise(small_rig("pinhole", surface), 0.1, seed)


@pytest.mark.parametrize("seed", [0, 1])
def test_start_goes_to_the_end_of_the_valley(seed: int) -> None:
    """Oracle: truth to 4 %, some four standard deviations."""
    rig = noisy(shallow_box(0.1), seed)
    start = search_start(rig.q, rig.camera, rig.unknown_projector, rig.size)
    assert start.projector.focal == pytest.approx(330, rel=0.04)


def test_solver_goes_along_a_valley() -> None:
    """Oracle: the optimum found from the truth; the start is 6 % off and follows its own valley."""
    rig = noisy(shallow_box(0.15), 0)
    ends = []
    for factor in (1.0, 0.94):
        start = known_start(
            rig.q, rig.camera, rig.projector.with_(focal=factor * 330), rig.projector_from_camera
        )
        ends.append(minimise(*problem_of([rig], starts=[start]), Options()))
    focals = [end.state.focals[0] for end in ends]
    assert all(end.outcome is Outcome.CONVERGED for end in ends)
    assert focals[1] == pytest.approx(focals[0], rel=0.01)


@pytest.mark.parametrize("seed", [0, 2])
def test_plane_ends_before_the_limit(seed: int) -> None:
    """The cost is flat along what a plane does not show: that ends it, and is said."""
    result = calibrate([map_of(noisy(PLANE, seed))], rig_file(noisy(PLANE, seed)))
    solution = result.solution
    assert solution.outcome in (Outcome.CONVERGED, Outcome.STALLED)
    assert len(result.trace) < 50
    assert solution.projector.focal.status == "unobservable"
    if solution.outcome is Outcome.STALLED:
        assert any("hardly determine" in w for w in solution.warnings)


def test_nothing_is_measured_before_the_end() -> None:
    """Oracle: one iteration allowed of many; a small deviation does not make a value measured."""
    rig = noisy(shallow_box(1.0), 0)
    given = {"focal": {"value": 300.0}, "pose": {"R": np.eye(3).tolist(), "t": [-6.0, 1.3, 0.7]}}
    solution = calibrate(
        [map_of(rig)], rig_file(rig, projector=given), Options(max_iterations=1)
    ).solution
    assert solution.outcome is Outcome.MAX_ITERATIONS
    assert solution.projector.focal.status != "measured"
    assert solution.frames[0].projector_from_camera.status != "measured"
    assert any("not converged" in w for w in solution.warnings)

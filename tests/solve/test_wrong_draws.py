"""Draws of the wrong models' benchmark that once were wrong by many stated deviations.

Oracle: the rigs that were drawn.
"""

import numpy as np
import pytest

from mitsuba_endo.records.solution import Solution
from scripts.benchmarks.model_error import solution_and_truth

pytestmark = pytest.mark.usefixtures("llvm")


def worst(kind: str, seed: int) -> tuple[Solution, float]:
    """Return a draw's solution and the largest error of its projector's position, deviations."""
    solution, truth = solution_and_truth(kind, seed)
    pose = solution.frames[0].projector_from_camera
    if pose.t is None or pose.std is None:
        return solution, 0.0
    off = np.subtract(pose.t, truth.projector_from_camera.t)
    return solution, float(np.abs(off / np.array(pose.std[3:])).max())


@pytest.mark.parametrize(("kind", "seed"), [("no distortion", 9701), ("half resolution", 9701)])
def test_refits_find_what_the_fit_was_led_away_from(kind: str, seed: int) -> None:
    """They were off by 133 and 42 deviations: the refits began where the fit had been led."""
    solution, deviations = worst(kind, seed)
    assert solution.model["suspected"]
    assert deviations < 3


@pytest.mark.parametrize(
    ("kind", "seed"), [("camera cx + 4 px", 9712), ("camera aspect 2 %", 9713)]
)
def test_weak_traces_are_noticed(kind: str, seed: int) -> None:
    """They were off by 23 and 12 deviations, unnoticed."""
    solution, deviations = worst(kind, seed)
    assert solution.model["suspected"]
    assert deviations < 3

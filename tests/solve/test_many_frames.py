"""Many frames: stopped in the middle, and under a plan that is wrong."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from mitsuba_endo import backend
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.checkpoint import Checkpoint
from mitsuba_endo.records.solution import Estimate, Outcome
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.solve.views import (
    FOCAL,
    Views,
    frame_errors,
    look,
    projector_poses,
    relief_surface,
    steps,
)

pytestmark = pytest.mark.usefixtures("llvm")

COUNT, DONE = 4, 3
QUICK = Options(jackknife=False, check_model=False)


@pytest.fixture(scope="module")
def views() -> Views:
    backend.ensure()
    return look(relief_surface(), steps(COUNT), projector_poses(COUNT))


def stop_at(*steps: str) -> Callable[[float, str], None]:
    """Return a progress callback that acts as Ctrl-C when each of some steps first begins."""
    left = list(steps)

    def progress(_share: float, step: str) -> None:
        if left and step.startswith(left[0]):
            del left[0]
            raise KeyboardInterrupt

    return progress


def _focal(calibration: Calibration) -> tuple[float, float]:
    focal: Estimate = calibration.solution.projector.focal
    assert focal.std is not None
    return cast(float, focal.value), cast(float, focal.std)


def test_frames_that_are_done_are_brought_together(views: Views):
    """Stopped while frames are solved alone. Oracle: the truth; the others are left out by name,
    and the calibration of those that were done goes on from there."""
    rig, alone = views.rig(), f"Solving every frame alone, frame {DONE + 1} of {COUNT}"
    stopped = calibrate(views.maps, rig, QUICK, stop_at(alone))
    solution = stopped.solution
    assert solution.outcome is Outcome.INTERRUPTED
    assert [f.name for f in solution.frames] == ["view0", "view1", "view2"]
    (left,) = solution.left_out
    assert (left.name, left.reason) == ("view3", "the calibration was stopped before its turn")
    value, _ = _focal(stopped)
    assert abs(value / FOCAL - 1) < 0.01
    for frame in solution.frames:
        assert frame_errors(views, frame).position < 1.0
    assert np.isfinite(stopped.frames[2].rendered).any()
    assert isinstance(stopped.checkpoint, Checkpoint)
    again = calibrate(views.maps, rig, QUICK, resume=stopped.checkpoint)
    assert again.solution.outcome is Outcome.CONVERGED
    value, std = _focal(again)
    assert abs(value - FOCAL) < 4 * std


def test_stopped_twice_or_before_two_frames_nothing_is_kept(views: Views):
    """Oracle: the interrupt reaches the caller."""
    step = "Solving every frame alone, frame"
    for stops in ([f"{step} 2 of"], [f"{step} {DONE + 1} of", "Stopping: computing"]):
        with pytest.raises(KeyboardInterrupt):
            calibrate(views.maps, views.rig(), QUICK, stop_at(*stops))


@pytest.mark.parametrize("step", ["Testing the model", "Computing standard deviations"])
def test_what_was_found_is_kept_while_its_accuracy_is_computed(views: Views, step: str):
    """Oracle: the same calibration without what was not yet computed."""
    full = Options(max_iterations=3)
    stopped = calibrate(views.maps[:2], views.rig(), full, stop_at(step))
    plain = calibrate(
        views.maps[:2], views.rig(), replace(full, check_model=False, jackknife=False)
    )
    assert stopped.solution.outcome is Outcome.INTERRUPTED
    assert _focal(stopped) == pytest.approx(_focal(plain), rel=1e-9)


@pytest.mark.slow
def test_a_wrong_plan_is_said_first_and_soon():
    """One projector pose for 20 frames in each of which it is elsewhere. Oracle: what was shown."""
    views = look(relief_surface(), steps(20), projector_poses(20), width=160)
    rig = views.rig(share={"projector_pose": "shared"})
    began = time.process_time()
    solution = calibrate(views.maps, rig).solution
    assert time.process_time() - began < 180  # some 55 s where nothing else runs
    first = solution.verdict[0]
    assert first.startswith("Plan: wrong; with one projector pose for all, ")
    assert "--share projector_pose=per_frame" in first
    assert solution.projector.focal.status != "measured"

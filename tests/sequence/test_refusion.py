"""Which frames are adjusted together, and which are placed on what came out."""

import numpy as np
import pytest

from mitsuba_endo.evaluate.trajectory_errors import (
    absolute_trajectory_error,
    trajectory_alignment,
)
from mitsuba_endo.sequence.adjustment import refusion
from mitsuba_endo.sequence.adjustment.drift_and_gauge import Plan
from mitsuba_endo.sequence.adjustment.refusion import FinishedPart, finish_part
from mitsuba_endo.sequence.run import Recorded
from tests.sequences import Recording


def _finished(recorded: Recorded) -> FinishedPart:
    (part,) = recorded.parts
    plan = Plan(part.setup.drift)
    found = finish_part(part.views, part.volume, part.setup.projector, plan, part.setup.seed)
    assert found is not None
    return found


def _error(found: FinishedPart, truth: Recording) -> float:
    ours = [found.poses[k].poses.world_from_camera for k in sorted(found.poses)]
    true = [truth.world_from_camera[k] for k in sorted(found.poses)]
    by = trajectory_alignment(ours, true, "rigid")
    return float(np.sqrt(np.mean(absolute_trajectory_error(ours, true, by) ** 2)))


def test_of_a_short_sequence_all_frames_are_adjusted(
    recorded: Recorded, colon: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the truth. All frames of 24 are adjusted; were they too many, a third would be, the
    others placed on these, and the way would be no better."""
    whole = _finished(recorded)
    placed = [row.number for row in recorded.rows if not row.lost]
    assert [frame.number for frame in whole.adjusted.frames] == placed
    monkeypatch.setattr(refusion, "FEW", 20)
    some = _finished(recorded)
    assert len(some.adjusted.frames) == len(recorded.parts[0].views.fused) < 20
    assert sorted(some.poses) == sorted(whole.poses) == placed
    errors = _error(whole, colon), _error(some, colon)
    assert errors[0] < errors[1] < 0.15  # mm

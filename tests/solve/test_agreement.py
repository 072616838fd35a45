"""The limits of agreement. Oracle: the table below; whole solves are in ``test_bad_frames``."""

import numpy as np
import pytest

from mitsuba_endo.solve.agreement import Agreement, worst

RIGHT = Agreement("right", 0.9, 1.03, 0.01)
FOLDS = Agreement("folds", 1.0, 1.2, 0.2)
STRAY = Agreement("stray", 0.15, 1.05, 0.0)
ALONE = Agreement("alone", 0.0, np.inf, 0.0)
OTHER = Agreement("other", 0.7, 9.0, 0.6)
WORSE = Agreement("worse", 0.7, 20.0, 0.6)
SPOTTED = Agreement("spotted", 0.8, 1.1, 0.5)


@pytest.mark.parametrize("frame", [STRAY, ALONE, OTHER, SPOTTED], ids=lambda a: a.name)
def test_wrong(frame: Agreement) -> None:
    assert frame.wrong
    assert worst([RIGHT, frame, FOLDS]) == 1
    assert "inf" not in frame.reason
    assert f"{100 * frame.common:.0f} %" in frame.reason


def test_right() -> None:
    assert worst([RIGHT, FOLDS]) is None
    assert not RIGHT.doubtful
    assert Agreement("between", 0.9, 1.5, 0.1).doubtful


def test_strays_go_first_then_the_worst() -> None:
    """A stray hardly disturbs and is certain; the larger misfit is the stranger."""
    assert worst([OTHER, STRAY, WORSE]) == 1
    assert worst([OTHER, RIGHT, WORSE]) == 2
